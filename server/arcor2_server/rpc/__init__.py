"""Handlers of the requests of the websocket protocol, one module per subject."""
