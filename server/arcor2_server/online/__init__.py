"""The server's side of the cell host: its processes, the scene when it is online."""
