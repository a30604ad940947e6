"""Benches of this repository's drivers, on their fakes. The suite finds the benches of each module."""
