"""Random edits of several clients over the websocket endpoint."""
