"""Data shared by connected users: presence, locks, previews, view states and tasks."""
