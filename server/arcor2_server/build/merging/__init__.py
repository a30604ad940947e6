"""Preserves comments and formatting of a script that a person has edited."""
