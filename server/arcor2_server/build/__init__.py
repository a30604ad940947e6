"""Builds projects into execution packages with a Python script, and imports packages."""
