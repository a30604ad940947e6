"""One folder per device: the object type, its transport codec and its quality file."""
