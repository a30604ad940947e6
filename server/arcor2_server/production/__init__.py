"""Recipes and their release, records of produced units, and the activity of the cell over time."""
