"""The websocket endpoints, the connected clients and the event hub."""
