"""The cell as a machine of a line: PackML state, mode and authority, and the Modbus block for the PLC above it."""
