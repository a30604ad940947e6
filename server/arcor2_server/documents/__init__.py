"""The open scene or project: its content, its checks, its journal."""

from arcor2_server.documents.session import Session

__all__ = ["Session"]
