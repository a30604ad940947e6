"""The functional tester, a Modbus TCP machine (docs/devices/functional-tester.md)."""
