"""Logging: set-up, redaction of secrets, the last lines in memory, the audit log."""
