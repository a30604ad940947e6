"""A scale with MT-SICS commands on a serial line or TCP (docs/devices/scale.md)."""
