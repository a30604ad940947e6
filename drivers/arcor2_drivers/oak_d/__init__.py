"""An OAK-D camera over depthai, or a network source of its pictures (docs/devices/oak-d.md)."""
