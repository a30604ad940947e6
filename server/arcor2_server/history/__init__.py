"""The history of points and runs."""
