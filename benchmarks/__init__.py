"""Figures of the whole product, measured on the machine at hand: `make bench`."""
