"""The open scene or project: its content, its checks, its journal."""

from arcor2_server.session.state import Session

__all__ = ["Session"]
