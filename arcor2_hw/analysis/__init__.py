"""Object type source to metadata, from text alone: what is read is never imported."""
