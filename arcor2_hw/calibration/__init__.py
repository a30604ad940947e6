"""Calibration: pure functions from pictures, depth and touched points to poses, each with a residual and a verdict."""
