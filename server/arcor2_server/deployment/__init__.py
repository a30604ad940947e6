"""Deployment: the service manager, backups, installation and upgrades."""
