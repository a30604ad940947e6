"""Vacuum gripper on the outputs of a robot or of an I/O block."""
