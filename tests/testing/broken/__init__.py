"""For each case of the suite a driver or device that fails only this case, based on toy_press.py."""
