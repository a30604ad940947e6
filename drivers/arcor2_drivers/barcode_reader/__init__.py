"""The barcode reader on a serial line or TCP (docs/devices/barcode-reader.md)."""
