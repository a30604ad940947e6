"""One websocket connection to a server: requests matched to answers by id, events in the order they come."""

import asyncio
import contextlib
import itertools
from collections.abc import AsyncIterator
from types import TracebackType
from typing import Any, Final, Self

import msgspec
from msgspec import UNSET, Raw, Struct
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import EVENTS, ChangeType, Event
from arcor2_hw.data.rpc import RPCS, RegisterUserArgs
from arcor2_hw.exceptions import Arcor2Error, ConnectionLost, DeviceTimeout, InvalidData

ANSWER_TIMEOUT: Final = 30.0
"""Seconds to wait for an answer: what existing clients wait."""
OPEN_TIMEOUT: Final = 10.0


class RequestFailed(Arcor2Error):
    """The server answered that it would not, or could not; the text is the server's."""

    code = "request_failed"

    def __init__(self, request: str, messages: list[str], data: Any = None) -> None:
        super().__init__(" ".join(messages) or f"{request} failed")
        self.request = request
        self.data = data


class _Message(Struct):
    """An answer or an event, before its data is decoded."""

    id: int = 0
    response: str = ""
    result: bool = False
    messages: list[str] = msgspec.field(default_factory=list)
    event: str = ""
    change_type: ChangeType | Unset = UNSET
    parent_id: str | Unset = UNSET
    data: Raw | Unset = UNSET


_decode = msgspec.json.Decoder(_Message).decode
_END: Final = object()


class Client:
    """A connection. Use it as `async with Client(url, user_name) as client`.

    `events()` gives what the server tells, in order; an event that nobody takes waits in the queue.
    """

    def __init__(self, url: str, user_name: str | None = None, *, timeout: float = ANSWER_TIMEOUT) -> None:
        self._url = url.replace("http://", "ws://", 1).replace("https://", "wss://", 1)
        self._user_name = user_name
        self._timeout = timeout
        self._ids = itertools.count(1)
        self._waiting: dict[int, asyncio.Future[_Message]] = {}
        self._events: asyncio.Queue[Any] = asyncio.Queue()
        self._socket: ClientConnection | None = None
        self._reader: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Self:
        await self.open()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def open(self) -> None:
        """Connect and, when there is a user name, register it. Raises ConnectionLost naming the address."""
        try:
            self._socket = await connect(
                self._url, max_size=None, compression=None, open_timeout=OPEN_TIMEOUT, close_timeout=1.0
            )
        except (OSError, TimeoutError) as e:
            raise ConnectionLost(f"No server answers at {self._url}.", str(e)) from e
        self._reader = asyncio.create_task(self._read(self._socket), name="client reader")
        if self._user_name is not None:
            await self.call("RegisterUser", RegisterUserArgs(self._user_name))

    async def close(self) -> None:
        """Close the connection; harmless when it is closed."""
        if self._socket is not None:
            await self._socket.close()
        if self._reader is not None:
            self._reader.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._reader
            self._reader = None

    async def _read(self, socket: ClientConnection) -> None:
        try:
            async for text in socket:
                message = _decode(text)
                if not message.event:
                    future = self._waiting.pop(message.id, None)
                    if future is not None and not future.done():
                        future.set_result(message)
                    continue
                declared = EVENTS.get(message.event)
                data: Any = UNSET
                if not isinstance(message.data, Unset):
                    kind = Any if declared is None or declared.data is None else declared.data
                    data = msgspec.json.decode(message.data, type=kind)
                self._events.put_nowait(Event(message.event, message.change_type, message.parent_id, data))
        except ConnectionClosed:
            pass
        finally:
            lost = ConnectionLost(f"The connection to {self._url} is closed.")
            for future in self._waiting.values():
                if not future.done():
                    future.set_exception(lost)
            self._waiting.clear()
            self._events.put_nowait(_END)

    async def call(self, name: str, args: Any = None, *, dry_run: bool = False, timeout: float | None = None) -> Any:
        """Send a request and give its data, decoded as the protocol declares it.

        Raises RequestFailed with the server's text, ConnectionLost, DeviceTimeout when no answer comes in time.
        """
        if self._socket is None:
            raise ConnectionLost(f"There is no connection to {self._url}.")
        number = next(self._ids)
        request: dict[str, Any] = {"id": number, "request": name}
        if args is not None:
            request["args"] = args
        if dry_run:
            request["dry_run"] = True
        future: asyncio.Future[_Message] = asyncio.get_running_loop().create_future()
        self._waiting[number] = future
        limit = self._timeout if timeout is None else timeout
        try:
            await self._socket.send(msgspec.json.encode(request).decode())
            async with asyncio.timeout(limit):
                message = await future
        except TimeoutError:
            raise DeviceTimeout(f"The server did not answer {name} within {limit:g} s.") from None
        except ConnectionClosed:
            raise ConnectionLost(f"The connection to {self._url} is closed.") from None
        finally:
            self._waiting.pop(number, None)
        declared = RPCS.get(name)
        data = None
        if not isinstance(message.data, Unset):
            kind = Any if declared is None or declared.data is None else declared.data
            try:
                data = msgspec.json.decode(message.data, type=kind)
            except msgspec.ValidationError as e:
                raise InvalidData(f"The server's answer to {name} has a wrong form.", str(e)) from e
        if not message.result:
            raise RequestFailed(name, message.messages, data)
        return data

    async def events(self) -> AsyncIterator[Event]:
        """Give the events as they come; ends when the connection does."""
        while (event := await self._events.get()) is not _END:
            yield event
        self._events.put_nowait(_END)

    async def next_event(self, *names: str, timeout: float = ANSWER_TIMEOUT) -> Event:
        """Give the next event with one of the names, dropping others; any event when no name is given."""
        try:
            async with asyncio.timeout(timeout):
                async for event in self.events():
                    if not names or event.event in names:
                        return event
        except TimeoutError:
            raise DeviceTimeout(f"No event {' or '.join(names) or 'at all'} within {timeout:g} s.") from None
        raise ConnectionLost(f"The connection to {self._url} is closed.")
