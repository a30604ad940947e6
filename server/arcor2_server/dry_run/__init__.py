"""Dry runs: the predicted times of the open project, without devices."""
