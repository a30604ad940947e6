"""Maintenance of devices: identity, operating hours, and backups of parameters."""
