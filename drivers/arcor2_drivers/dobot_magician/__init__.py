"""Dobot Magician: a desktop arm of four axes on a serial port."""
