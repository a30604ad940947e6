"""Object types known to the server: installed and uploaded ones, read by analysis."""
