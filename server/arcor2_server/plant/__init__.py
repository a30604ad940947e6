"""The data of the cell for plant systems, and the processes that provide it."""
