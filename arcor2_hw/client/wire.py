"""One websocket: answers matched to requests by id, events delivered in order."""

import asyncio
import contextlib
import itertools
import ssl
from collections.abc import Callable
from typing import Any, Final

import msgspec
from msgspec import UNSET, Raw, Struct
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI
from websockets.protocol import State

from arcor2_hw.client.errors import AnswerTimeout, EventsMissed, NotAdmitted
from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import EVENTS, ChangeType, Event
from arcor2_hw.exceptions import ConnectionLost

OPEN_TIMEOUT: Final = 10.0
"""Time limit of connecting, s."""
PING_INTERVAL: Final = 10.0
PING_TIMEOUT: Final = 20.0
"""Time without an answer to a ping after which the connection is lost, s.

An unplugged cable is not reported otherwise.
"""
NOT_ADMITTED: Final = 4401
"""Close code of the server for a token that is not valid."""


class Unsent(Exception):
    """The connection was lost before anything was sent."""


class Unanswered(Exception):
    """The connection broke between request and answer."""


class Message(Struct):
    """An answer or an event, before its data is decoded."""

    id: int = 0
    response: str = ""
    result: bool = False
    messages: list[str] = msgspec.field(default_factory=list)
    code: str = ""
    event: str = ""
    change_type: ChangeType | Unset = UNSET
    parent_id: str | Unset = UNSET
    data: Raw | Unset = UNSET


_decode = msgspec.json.Decoder(Message).decode
_event_decoders: dict[str, Callable[[Any], Any]] = {
    name: msgspec.json.Decoder(Any if declared.data is None else declared.data).decode
    for name, declared in EVENTS.items()
}
_decode_any = msgspec.json.Decoder().decode


def _read(text: str | bytes) -> Message | Event | EventsMissed:
    """Return an answer undecoded, or an event with its data; EventsMissed for an invalid message."""
    try:
        message = _decode(text)
        if not message.event:
            return message
        data: Any = UNSET
        if not isinstance(message.data, Unset):
            decode: Callable[[Any], Any] = _event_decoders.get(message.event, _decode_any)
            data = decode(message.data)
    except (msgspec.DecodeError, RecursionError):
        return EventsMissed(1)
    return Event(message.event, message.change_type, message.parent_id, data)


class Wire:
    """An open connection. `closed` is set when nothing more can be received."""

    def __init__(self, socket: ClientConnection, url: str, deliver: Callable[[Event | EventsMissed], None]) -> None:
        self.closed = asyncio.Event()
        self._socket = socket
        self._url = url
        self._deliver = deliver
        self._ids = itertools.count(1)
        self._waiting: dict[int, asyncio.Future[Message]] = {}
        self._reader = asyncio.create_task(self._follow(), name="client reader")

    @classmethod
    async def open(
        cls, url: str, token: str | None, tls: ssl.SSLContext | None, deliver: Callable[[Event | EventsMissed], None]
    ) -> "Wire":
        """Connect.

        Raises:
            ConnectionLost: The server does not answer; the message names its address.
        """
        headers = None if token is None else {"Authorization": f"Bearer {token}"}
        try:
            socket = await connect(
                url,
                additional_headers=headers,
                ssl=tls if tls is not None and url.startswith("wss:") else None,
                max_size=None,
                compression=None,
                open_timeout=OPEN_TIMEOUT,
                close_timeout=1.0,
                ping_interval=PING_INTERVAL,
                ping_timeout=PING_TIMEOUT,
            )
        except (OSError, TimeoutError, InvalidHandshake, InvalidURI, EOFError) as e:
            # ssl.SSLError is an OSError; the message names an untrusted certificate.
            why = f": {e}" if isinstance(e, ssl.SSLError | InvalidHandshake | InvalidURI) else "."
            raise ConnectionLost("The server at {url} does not answer{reason}", str(e), url=url, reason=why) from e
        return cls(socket, url, deliver)

    async def close(self) -> None:
        """Close the connection. It does nothing when the connection is closed."""
        await self._socket.close()
        self._reader.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await self._reader

    @property
    def refused(self) -> NotAdmitted | None:
        """Return the error if the server closed the connection because of the token."""
        if self._socket.close_code != NOT_ADMITTED:
            return None
        return NotAdmitted(
            "The server at {url} does not admit this client: {close_reason}",
            url=self._url,
            close_reason=self._socket.close_reason or "no valid token",
        )

    async def _follow(self) -> None:
        try:
            async for text in self._socket:
                read = _read(text)
                if not isinstance(read, Message):
                    self._deliver(read)
                    continue
                future = self._waiting.pop(read.id, None)
                if future is not None and not future.done():
                    future.set_result(read)
        except ConnectionClosed:
            pass
        finally:
            for future in self._waiting.values():
                if not future.done():
                    future.set_exception(Unanswered())
                    future.exception()  # the waiting task may be gone
            self._waiting.clear()
            self.closed.set()

    async def ask(self, name: str, args: Any, dry_run: bool, limit: float) -> Message:
        """Send a request and return the answer undecoded.

        Raises:
            Unsent: Nothing was sent.
            Unanswered: The connection broke before the answer.
            AnswerTimeout: No answer was received within `limit` s.
        """
        if self._socket.state is not State.OPEN or self.closed.is_set():
            raise Unsent
        number = next(self._ids)
        request: dict[str, Any] = {"id": number, "request": name, "codes": True}
        if args is not None:
            request["args"] = args
        if dry_run:
            request["dry_run"] = True
        text = msgspec.json.encode(request).decode()
        future: asyncio.Future[Message] = asyncio.get_running_loop().create_future()
        self._waiting[number] = future
        try:
            async with asyncio.timeout(limit):
                await self._socket.send(text)
                return await future
        except TimeoutError:
            raise AnswerTimeout(name, limit) from None
        except ConnectionClosed:
            raise Unanswered from None
        finally:
            self._waiting.pop(number, None)
