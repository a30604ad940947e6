"""Remote I/O block and tower light on Modbus TCP or RTU (docs/devices/remote-io.md)."""
