"""Per case of the suite a driver, or a device, that breaks only that one; each runs beside toy_press.py."""
