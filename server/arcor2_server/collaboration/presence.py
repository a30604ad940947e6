"""Presence: connected users, and the items that they view and edit."""

from collections.abc import Iterable
from typing import Final

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.editor import Presence, UserPresenceData
from arcor2_hw.data.events import Event
from arcor2_hw.data.role import Role
from arcor2_server.collaboration.throttle import Throttle
from arcor2_server.collaboration.users import Users
from arcor2_server.errors import RequestRefused
from arcor2_server.events import Connection, EventHub, encode, make_event

PERIOD: Final = 1 / 15
"""Minimum time between two events of one user, s."""


class PresenceBoard:
    """The presence of each connected user, as last reported by the client."""

    def __init__(self, hub: EventHub, users: Users) -> None:
        self._hub = hub
        self._users = users
        self._presence: dict[str, Presence] = {}
        self._events = Throttle(PERIOD, lambda user, event: hub.stream_to_subscribers("UserPresence", user, event))
        users.on_enter.append(self._entered)
        users.on_leave.append(self._left)

    def all_events(self) -> list[Event]:
        """Return the events that describe all connected users."""
        return [self._event(name, self._presence.get(name, UNSET)) for name in self._users.names()]

    def users_of(self, documents: Iterable[str]) -> list[str]:
        """Return the users who have one of these scenes or projects open.

        Users whose clients do not report their presence are included, unless their role is too low to open a document.
        """
        shown, found = set(documents), []
        for name in self._users.names():
            client, presence = self._users.client_of(name), self._presence.get(name)
            may_edit = client is not None and client.role >= Role.STANDARD_USER
            if presence.document in shown if presence is not None else may_edit:
                found.append(name)
        return found

    def update(self, client: Connection, presence: Presence) -> None:
        """Store and publish the presence of a client. Raise RequestRefused if it cannot be encoded."""
        user = client.user
        assert user is not None
        try:
            event = encode(self._event(user, presence))
        except UnicodeEncodeError as error:
            raise RequestRefused("The presence cannot be sent to other clients: {reason}.", reason=error) from None
        self._presence[user] = presence
        self._events.put(user, event)

    def close(self) -> None:
        """Cancel the pending events."""
        self._events.close()

    def _event(self, user: str, presence: Presence | Unset = UNSET) -> Event:
        client = self._users.client_of(user)
        role = "" if client is None else client.role.name.lower()
        return make_event("UserPresence", UserPresenceData(user, client is not None, role, presence))

    def _entered(self, user: str) -> None:
        self._presence.pop(user, None)
        self._events.put(user, encode(self._event(user)))

    def _left(self, user: str) -> None:
        self._presence.pop(user, None)
        self._events.end(user, encode(make_event("UserPresence", UserPresenceData(user, False, ""))))
