"""The two-axis fine-manipulation robot on Dynamixel protocol 2.0 (docs/devices/two-axis-robot.md)."""
