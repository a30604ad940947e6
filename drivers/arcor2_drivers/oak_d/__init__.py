"""Luxonis OAK-D cameras: over depthai, or as a network stream of images (docs/devices/oak-d.md)."""
