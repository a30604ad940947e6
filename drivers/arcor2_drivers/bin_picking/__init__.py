"""Bin and blister: the next part in a crate from a depth image, or in a grid by counting (docs/devices)."""
