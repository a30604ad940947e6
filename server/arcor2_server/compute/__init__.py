"""Clients of the compute workers, the processes for numerical computations."""
