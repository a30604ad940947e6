"""Recipes and their release, records of produced units, and what the cell does when."""
