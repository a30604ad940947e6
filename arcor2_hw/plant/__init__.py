"""Shared parts of the processes for plant systems: the data of the cell, and their connection to the server."""
