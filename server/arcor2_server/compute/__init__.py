"""Clients of the compute workers, the processes that run numerics."""
