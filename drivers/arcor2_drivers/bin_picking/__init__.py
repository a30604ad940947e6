"""Bin and blister: the next part in a crate by a depth picture, in a grid by counting (docs/devices)."""
