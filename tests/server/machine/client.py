"""A client of the random edits, with its own copy of the state."""

from typing import Any

from tests.server.document_copy import DocumentCopy
from tests.server.session.session_server import Person, SessionServer

Flat = dict[tuple[str, str], Any]


def flat(copy: DocumentCopy) -> Flat:
    """Return every item by kind and id, so that states can be compared item by item."""
    found: Flat = {}
    for kind, content in copy.content().items():
        if kind in ("scene", "project"):
            found[kind, ""] = content
        else:
            found |= {(kind, key): value for key, value in content.items()}
    return found


class Client:
    """A connection with a copy of the state, updated by events."""

    def __init__(self, server: SessionServer, name: str) -> None:
        self.name = name
        self.person = Person(server)
        self.copy = DocumentCopy()
        self.events = 0

    def apply_events(self) -> None:
        for event in self.person.events():
            self.events += 1
            self.copy.apply(event)
