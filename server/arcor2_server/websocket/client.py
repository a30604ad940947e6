"""One connected client and its queue of messages."""

import asyncio
import enum
import itertools
import time
from collections import deque
from collections.abc import Callable
from typing import Final, Protocol

import structlog

from arcor2_hw.data.events import Event
from arcor2_hw.data.persons import Person
from arcor2_hw.data.role import Role
from arcor2_server.access.admission import right
from arcor2_server.access.tokens import Token
from arcor2_server.settings import ServerSettings

log = structlog.get_logger(__name__)
_numbers = itertools.count(1)


class CloseCode(enum.IntEnum):
    """Close codes of the server (RFC 6455 section 7.4; 4000 and above are private)."""

    GOING_AWAY = 1012
    """The server stops."""
    TOO_BIG = 1009
    """A message was too long to be drained."""
    NOT_ADMITTED = 4401
    """The token was wrong, revoked, expired, or did not arrive in time."""
    TOO_SLOW = 4008
    """The client received its messages too slowly."""


class Wire(Protocol):
    """The transport of a client."""

    def send_now(self, message: bytes) -> bool:
        """Send a text message if the buffer has room; return whether it was sent."""

    async def send(self, message: bytes) -> None:
        """Send a text message as soon as the buffer has room. Raise ConnectionError if the connection is closed."""

    async def ping(self) -> None:
        """Send a ping and wait for its answer."""

    async def close(self, code: int, reason: str) -> None:
        """Send a close frame and end the connection."""

    def admit(self) -> None:
        """Count the connection among the admitted ones."""

    def abort(self) -> None:
        """Close the connection at once."""


ABORT_AFTER: Final = 1.0
"""Time limit for sending a close frame before the connection is aborted, s."""


class Client:
    """A connected client. Messages are sent in order. Of each stream only the newest message is queued.

    Args:
        wire: the transport.
        settings: limits of the queue.
        address: the address of the client.
        greeting: returns the first events for the client, sent when it is admitted.
        events: names of the events for the client, None for all.
    """

    def __init__(
        self,
        wire: Wire,
        settings: ServerSettings,
        address: str = "",
        greeting: Callable[[], list[Event]] = list,
        events: frozenset[str] | None = None,
    ) -> None:
        self.number = next(_numbers)
        self.user: str | None = None
        self.address = address
        self.greeting = greeting
        self.events = events
        self.ceiling: Role = Role.OPERATOR
        """The role of the token, which no person exceeds at this device."""
        self.person: Person | None = None
        """The person who is logged on."""
        self.token: Token | None = None
        """The token of the client, if it sent one."""
        self.follows: frozenset[str] = frozenset()
        """Other users whose view states the client receives."""
        self.admitted = False
        """Before it is admitted, the client receives no events, and only Authenticate is served."""
        self._wire = wire
        self._settings = settings
        self._waiting: deque[bytes | str] = deque()  # a str is the name of a stream, see _newest
        self._newest: dict[str, bytes] = {}
        self._bytes = 0
        self._wake = asyncio.Event()
        self._sending_since: float | None = None
        self._closing: tuple[int, str] | None = None

    def __repr__(self) -> str:
        return f"<Client {self.number} {self.user or 'not logged in'}>"

    def admit(self, role: Role, token: Token | None = None) -> None:
        """Admit the client with a role."""
        self.ceiling, self.token, self.admitted = role, token, True
        self._wire.admit()
        if token is not None:
            log.info("client admitted", client=self.number, token=token.id, name=token.name, role=role.name.lower())

    @property
    def shared(self) -> bool:
        """Whether persons log on at this device."""
        return self.token is not None and self.token.shared

    @property
    def logged_off(self) -> bool:
        """Whether this device is shared and nobody is logged on, so that it may only watch and stop."""
        return self.shared and self.person is None

    @property
    def role(self) -> Role:
        """Role of the client: the lower one of the roles of its token and of the logged-on person."""
        person = None if self.person is None else Role[self.person.role.upper()]
        return right(self.ceiling, shared=self.shared, person=person)

    @property
    def device(self) -> str:
        """The id of the token, else the address."""
        return self.address if self.token is None else self.token.id

    @property
    def name(self) -> str:
        """The name of the user, else of the token; empty if both are unknown."""
        return self.user or ("" if self.token is None else self.token.name)

    @property
    def closed(self) -> bool:
        """Whether no more messages are sent."""
        return self._closing is not None

    def put(self, message: bytes) -> None:
        """Queue an encoded message. Close the connection if the client is too slow."""
        if not self._sent_or_closed(message):
            self._queue(message, len(message))

    def put_newest(self, stream: str, message: bytes) -> None:
        """Queue the newest message of a stream in place of the one that still waits."""
        if self._sent_or_closed(message):
            return
        previous = self._newest.get(stream)
        self._newest[stream] = message
        if previous is None:
            self._queue(stream, len(message))
        else:
            self._queue(None, len(message) - len(previous))

    def _sent_or_closed(self, message: bytes) -> bool:
        """Send a message at once if no other waits; return whether it need not be queued."""
        if self._closing is not None:
            return True
        return not self._waiting and self._sending_since is None and self._wire.send_now(message)

    def _queue(self, item: bytes | str | None, size: int) -> None:
        if item is not None:
            self._waiting.append(item)
        self._bytes += size
        if len(self._waiting) > 1 and self._lagging():
            self.close(CloseCode.TOO_SLOW, "too slow: messages were not taken")
        self._wake.set()

    def _lagging(self) -> bool:
        limits = self._settings
        stuck = self._sending_since is not None and time.monotonic() - self._sending_since > limits.outgoing_age
        return stuck or self._bytes > limits.outgoing_bytes or len(self._waiting) > limits.outgoing_messages

    def close(self, code: int, reason: str) -> None:
        """Close the connection. Queued messages are discarded."""
        if self._closing is not None:
            return
        log.info("client closed", client=self.number, user=self.user, code=int(code), reason=reason)
        self._end(code, reason)
        self._wake.set()
        if self._sending_since is not None:
            # The writer waits for a full buffer, so the close frame cannot be sent either.
            asyncio.get_running_loop().call_later(ABORT_AFTER, self._wire.abort)

    def lost(self) -> None:
        """Stop sending, since the connection is closed."""
        if self._closing is None:
            self._end(1006, "the connection is lost")

    def _end(self, code: int, reason: str) -> None:
        self._closing = (code, reason)
        self._waiting.clear()
        self._newest.clear()
        self._bytes = 0

    async def ping(self, within: float) -> bool:
        """Return whether the client answers a ping in time. `within`: time limit, s."""
        try:
            async with asyncio.timeout(within):
                await self._wire.ping()
        except (TimeoutError, ConnectionError):
            return False
        return True

    async def write(self) -> None:
        """Send queued messages until the connection ends. Run this as a separate task."""
        waiting, newest = self._waiting, self._newest
        try:
            while True:
                while waiting:
                    item = waiting.popleft()
                    message = newest.pop(item) if isinstance(item, str) else item
                    self._sending_since = time.monotonic()
                    await self._wire.send(message)
                    self._sending_since = None
                    self._bytes = max(0, self._bytes - len(message))
                if self._closing is not None:
                    await self._close_wire(*self._closing)
                    return
                self._wake.clear()
                await self._wake.wait()
        except ConnectionError:
            self.lost()

    async def _close_wire(self, code: int, reason: str) -> None:
        try:
            async with asyncio.timeout(ABORT_AFTER):
                await self._wire.close(code, reason)
        except TimeoutError:
            self._wire.abort()
