"""Fake PLC with an OPC UA server (docs/devices/opcua-plc.md): points, jobs by a handshake, life signs both ways.

The OPC UA stack is asyncua, behind a proxy that simulates faults. Not modelled: events, methods, history, structured
values, scan time, roles, limits of a server, points that are used by jobs.
"""

WIRE = "OPC UA binary on TCP"
