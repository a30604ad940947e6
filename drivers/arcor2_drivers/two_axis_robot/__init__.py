"""Two-axis robot: a planar arm of two Dynamixel servos on protocol 2.0."""
