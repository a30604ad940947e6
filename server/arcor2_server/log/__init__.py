"""Logging: configuration, redaction of secrets, recent lines in memory, audit log."""
