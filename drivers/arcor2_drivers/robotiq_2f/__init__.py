"""The Robotiq 2F gripper on the URCap's ASCII port or on Modbus RTU (docs/devices/robotiq-2f.md)."""
