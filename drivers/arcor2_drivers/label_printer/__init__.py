"""A label printer that speaks ZPL, on a serial line or TCP (docs/devices/label-printer.md)."""
