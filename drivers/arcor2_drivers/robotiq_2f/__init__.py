"""Robotiq 2F grippers on the ASCII port of the URCap or on Modbus RTU."""
