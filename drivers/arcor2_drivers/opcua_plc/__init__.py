"""A PLC over OPC UA: named points, and jobs by a handshake (docs/devices/opcua-plc.md)."""
