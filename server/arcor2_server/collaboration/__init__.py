"""What connected users share: presence, locks, previews, view states and tasks."""
