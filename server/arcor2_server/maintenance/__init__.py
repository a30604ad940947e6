"""Maintenance of devices: which device is connected, how long it has worked, and backups of its parameters."""
