"""Alarms: their declarations, the records of their occurrences, and the alarms of the system itself."""
