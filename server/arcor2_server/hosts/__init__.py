"""Cell hosts, the processes that own the device instances."""
