"""A conveyor with a servo drive, CANopen CiA 402 (docs/devices/conveyor.md)."""
