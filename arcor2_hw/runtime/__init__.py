"""The cell host: the one process that owns device instances, and the script side of a package."""
