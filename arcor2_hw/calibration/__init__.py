"""Calibration: pure functions from images, depth and touched points to poses, each with a residual and a verdict."""
