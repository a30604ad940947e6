"""Registered users and their connections; releases the locks of users who left."""

import asyncio
from collections.abc import Callable
from typing import Final

import structlog

from arcor2_hw.data.base import now
from arcor2_hw.data.events import Event, LockData, NotificationData, NotificationLevel
from arcor2_hw.messages import Message
from arcor2_server.collaboration.locks import Locks
from arcor2_server.errors import RequestRefused
from arcor2_server.events import Connection, EventHub, make_event
from arcor2_server.settings import ServerSettings

log = structlog.get_logger(__name__)

PONG_TIMEOUT: Final = 1.0
"""Time limit for the connection of a registered user to answer a ping and keep the name, s (protocol, section 3)."""

MAX_NOTICES: Final = 20
"""Maximum number of notices for a returning user; older ones are dropped."""

MAX_USERS_WITH_NOTICES: Final = 200
"""Maximum number of disconnected users for whom notices are stored."""


class Users:
    """The registered users, each with one connection."""

    def __init__(self, hub: EventHub, locks: Locks, settings: ServerSettings) -> None:
        self._hub = hub
        self._locks = locks
        self._timeout = settings.lock_timeout
        self._clients: dict[str, Connection] = {}
        self._releases: dict[str, asyncio.TimerHandle] = {}
        self._left: dict[str, str] = {}
        self._notices: dict[str, list[Message]] = {}
        self.on_enter: list[Callable[[str], None]] = []
        self.on_leave: list[Callable[[str], None]] = []
        """Called with the name of a user who registers or leaves."""

    def client_of(self, user: str) -> Connection | None:
        """Return the connection of a user."""
        return self._clients.get(user)

    def names(self) -> list[str]:
        """Return the names of the registered users."""
        return list(self._clients)

    def left_at(self, user: str) -> str | None:
        """Return the time at which the connection of a user with locks closed; None while the user is connected."""
        return self._left.get(user)

    def require_left(self, user: str) -> None:
        """Raise RequestRefused while a user is connected."""
        if user in self._clients:
            raise RequestRefused("{user} is connected. Ask {user} to unlock it.", user=user)

    def release(self, user: str, notice: Message) -> list[str]:
        """Release all locks of a user who left and return their ids. The notice is sent when the user returns."""
        waiting = self._notices.pop(user, [])
        self._notices[user] = [*waiting, notice][-MAX_NOTICES:]
        while len(self._notices) > MAX_USERS_WITH_NOTICES:
            del self._notices[next(iter(self._notices))]
        return self._locks.release_all(user)

    async def register(self, client: Connection, name: str) -> list[Event]:
        """Register a user; return the events that describe the held locks to this client.

        Raises:
            RequestRefused: The name is empty, or another connected client has it.
        """
        if not name:
            raise RequestRefused("The user name must not be empty.")
        holder = self._clients.get(name)
        if holder is not None and holder is not client:
            if await holder.ping(PONG_TIMEOUT) or self._clients.get(name) not in (holder, None):
                raise RequestRefused("The user name {name!r} is already in use.", name=name)
            holder.user = None
        if client.user is not None and client.user != name:
            self._leave(client.user)
        self._clients[name] = client
        client.user = name
        if holder is not client:
            for notify in self.on_enter:
                notify(name)
        self._left.pop(name, None)
        if (handle := self._releases.pop(name, None)) is not None:
            handle.cancel()
        log.info("user registered", user=name, client=client.number)
        events = [
            make_event("ObjectsLocked", LockData(ids, owner))
            for owner, ids in self._locks.announced().items()
            if owner != name
        ]
        if own := self._locks.write_locked_by(name):
            events.append(make_event("ObjectsLocked", LockData(own, name)))
        for notice in self._notices.pop(name, []):
            data = NotificationData(notice.text, NotificationLevel.WARN, **notice.translation())
            events.append(make_event("Notification", data))
        return events

    def disconnected(self, client: Connection) -> None:
        """Unregister the user of a closed connection. The locks are released after a time limit."""
        if client.user is not None and self._clients.get(client.user) is client:
            self._leave(client.user)

    def unregister(self, client: Connection) -> None:
        """Unregister the user of a connection that stays open, and release the locks."""
        name = client.user
        self.disconnected(client)
        client.user = None
        if name is not None and name not in self._clients:
            if (handle := self._releases.get(name)) is not None:
                handle.cancel()
            self._release(name)

    def _leave(self, name: str) -> None:
        del self._clients[name]
        self._left[name] = now()
        for notify in self.on_leave:
            notify(name)
        if (handle := self._releases.pop(name, None)) is not None:
            handle.cancel()
        self._releases[name] = asyncio.get_running_loop().call_later(self._timeout, self._release, name)

    def _release(self, name: str) -> None:
        self._releases.pop(name, None)
        self._left.pop(name, None)
        if ids := self._locks.release_all(name):
            log.info("locks released after the time limit", user=name, ids=ids)
            self._hub.broadcast(make_event("ObjectsUnlocked", LockData(ids, name)))

    def close(self) -> None:
        """Cancel the pending releases."""
        for handle in self._releases.values():
            handle.cancel()
        self._releases.clear()
