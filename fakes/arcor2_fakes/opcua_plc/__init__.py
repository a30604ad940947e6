"""A fake PLC with an OPC UA server, after docs/devices/opcua-plc.md: points, jobs by a handshake, life signs both ways.

The OPC UA stack is asyncua's, behind a port of ours that can fail; the program of the PLC is ours. Not modelled:
events, methods, history, structured values, a scan that takes time, roles, limits of a server, points that jobs need.
"""

WIRE = "OPC UA binary on TCP"
