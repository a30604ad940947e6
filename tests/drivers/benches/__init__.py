"""Benches of the drivers of this repository, on their fakes; each module's benches are found by the suite."""
