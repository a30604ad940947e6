"""The MQTT clients of the cell, a process of its own: Sparkplug B, and plain JSON."""
