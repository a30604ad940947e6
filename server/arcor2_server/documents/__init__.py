"""The open scene or project: content, edits, journal, history and checks."""

from arcor2_server.documents.session import Session

__all__ = ["Session"]
