"""The HTTP server, the websocket transport and the static files of the web editor."""
