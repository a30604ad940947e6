"""Keeps the comments and the formatting of a script that a person has edited."""
