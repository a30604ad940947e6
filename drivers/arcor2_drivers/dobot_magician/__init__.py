"""The Dobot Magician, a desktop arm on a serial line (docs/devices/dobot-magician.md)."""
