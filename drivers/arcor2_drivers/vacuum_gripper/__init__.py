"""Vacuum gripper on the outputs of a robot or I/O block."""
