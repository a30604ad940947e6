"""The composition root: builds the parts of the server, the request handlers and the ASGI application."""

from arcor2_server.app.application import create_app
from arcor2_server.app.parts import Server, running_server

__all__ = ["Server", "create_app", "running_server"]
