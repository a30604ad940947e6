"""Checks of objects, actions, scenes and projects: pure functions over data and object types."""
