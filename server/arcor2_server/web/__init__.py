"""The HTTP server and the static files of the web editor."""
