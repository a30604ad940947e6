"""Control channel of a fake: JSON lines over TCP, to inject faults and to read the true state.

It is used by tests and by simulated worlds. Each request is a line, ``{"id": 1, "do": "truth", ...}``, with one answer,
``{"id": 1, "ok": true, "data": ...}`` or ``{"id": 1, "ok": false, "error": "..."}``.
``{"id": 2, "do": "subscribe", "to": "truth", "rate": 50}`` subscribes to events ``{"event": "truth", "data": ...}`` at
this rate, Hz; with rate 0 an event is sent when the fake calls `publish`.
``{"do": "unsubscribe", "to": "truth"}`` ends the subscription. ``{"do": "commands"}`` lists the commands,
``{"do": "describe"}`` their parameters.

`arcor2_fakes.serving` creates the `ControlServer` of a fake and registers the faults of its wires
(`arcor2_fakes.wire`). `ControlClient` (asyncio) and `BlockingControlClient` (tests) connect to it.
"""

import asyncio
import contextlib
import inspect
import itertools
import socket
import time
from collections.abc import Callable, Collection, Mapping
from types import TracebackType
from typing import Any, Self, TypeVar

import msgspec

MAX_LINE = 1 << 20  # bytes; the state of a fake takes some kilobytes
MAX_RATE = 500.0  # Hz

Handler = Callable[..., Any]
"""Called with the other fields of the request as keyword arguments; returns JSON data or an awaitable of it.

`ValueError`, `TypeError`, `LookupError` and `OSError` become the error of the answer.
"""

_encoder = msgspec.json.Encoder()
_decoder = msgspec.json.Decoder()


T = TypeVar("T")
N = TypeVar("N", int, float)


class ControlError(Exception):
    """The fake refused a command, or the control channel broke or did not answer in time."""


def parse_address(address: str) -> tuple[str, int]:
    """Return host and port of ``HOST:PORT``. Raise `ValueError` for another format."""
    host, separator, port = address.rpartition(":")
    if not separator or not host or not port.isdigit() or int(port) > 0xFFFF:
        raise ValueError(f"{address!r} is not HOST:PORT")
    return host.strip("[]"), int(port)


def one_of(name: str, value: T, allowed: Collection[T]) -> T:
    """Return an argument of a command. Raise `ValueError` unless it is one of the allowed values."""
    if value not in allowed:
        raise ValueError(f"{name} must be one of {', '.join(map(str, allowed))}")
    return value


def within(name: str, value: N, least: float, most: float) -> N:
    """Return a numeric argument of a command. Raise `ValueError` if it is outside of the range."""
    if not least <= value <= most:
        raise ValueError(f"{name} must be {least} to {most}")
    return value


class ControlServer:
    """Serves the control channel. Commands may be registered before or after `start`."""

    def __init__(self, host: str = "127.0.0.1", port: int = 0) -> None:
        self._bind = (host, port)
        self._server: asyncio.Server | None = None
        self._commands: dict[str, Handler] = {}
        self._sources: dict[str, Callable[[], Any]] = {}
        self._sessions: set[_Session] = set()

    def command(self, name: str, handler: Handler) -> None:
        """Register the function that ``{"do": name, ...}`` calls."""
        self._commands[name] = handler

    def source(self, name: str, read: Callable[[], Any]) -> None:
        """Register a value that clients can read by a command and subscribe to, such as the truth."""
        self._sources[name] = read
        self._commands[name] = read

    def publish(self, name: str) -> None:
        """Send the source `name` to the clients that subscribed to it with rate 0."""
        for session in tuple(self._sessions):
            session.changed(name)

    @property
    def address(self) -> str:
        """Return ``host:port``; after `start` the real port."""
        host, port = self._bind
        return f"{host}:{port}"

    async def start(self) -> str:
        """Listen and return the address. Raise `OSError` if the port is in use."""
        self._server = await asyncio.start_server(self._serve, *self._bind, limit=MAX_LINE)
        self._bind = (self._bind[0], self._server.sockets[0].getsockname()[1])
        return self.address

    async def close(self) -> None:
        """Close the port and all sessions."""
        if self._server is not None:
            self._server.close()
        sessions = tuple(self._sessions)
        for session in sessions:
            session.task.cancel()
        await asyncio.gather(*(session.task for session in sessions), return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        session = _Session(task, reader, writer, self._commands, self._sources)
        self._sessions.add(session)
        try:
            await session.run()
        except ConnectionError:
            pass  # the client has disconnected
        except asyncio.CancelledError:
            pass  # cancelled by `close`; the stream server would log that as an error
        finally:
            self._sessions.discard(session)
            session.end()


class _Session:
    """One client of the control channel."""

    def __init__(
        self,
        task: asyncio.Task[Any],
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        commands: Mapping[str, Handler],
        sources: Mapping[str, Callable[[], Any]],
    ) -> None:
        self.task = task
        self._reader, self._writer = reader, writer
        self._commands, self._sources = commands, sources
        self._pushing: dict[str, asyncio.TimerHandle | None] = {}

    async def run(self) -> None:
        while True:
            try:
                line = await self._reader.readuntil(b"\n")
            except asyncio.IncompleteReadError:
                return
            except asyncio.LimitOverrunError:
                self._send({"id": 0, "ok": False, "error": f"a line has at most {MAX_LINE} bytes"})
                await self._writer.drain()
                return  # the next request cannot be distinguished from the rest of the line
            if line.strip():
                self._send(await self._answer(line))
                await self._writer.drain()

    def end(self) -> None:
        for timer in self._pushing.values():
            if timer is not None:
                timer.cancel()
        self._pushing.clear()
        self._writer.close()

    def changed(self, name: str) -> None:
        if name in self._pushing and self._pushing[name] is None:
            self._push(name)

    async def _answer(self, line: bytes) -> dict[str, Any]:
        try:
            request = _decoder.decode(line)
        except (msgspec.DecodeError, UnicodeDecodeError) as e:
            return {"id": 0, "ok": False, "error": f"not JSON: {e}"}
        if not isinstance(request, dict):
            return {"id": 0, "ok": False, "error": "a request is an object"}
        number, name = request.pop("id", 0), request.pop("do", None)
        try:
            data = self._call(name, request)
            if inspect.isawaitable(data):
                data = await data
        except (ValueError, TypeError, LookupError, OSError) as e:
            return {"id": number, "ok": False, "error": f"{name}: {e}"}
        return {"id": number, "ok": True, "data": data}

    def _call(self, name: object, arguments: dict[str, Any]) -> Any:
        if name == "commands":
            return sorted({*self._commands, "commands", "describe", "subscribe", "unsubscribe"})
        if name == "describe":
            return [_described(command, handler) for command, handler in sorted(self._commands.items())]
        if name == "subscribe":
            return self._subscribe(**arguments)
        if name == "unsubscribe":
            return self._unsubscribe(**arguments)
        if not isinstance(name, str) or name not in self._commands:
            raise ValueError("unknown command")
        return self._commands[name](**arguments)

    def _subscribe(self, to: str = "truth", rate: float = 0.0) -> None:
        if to not in self._sources:
            raise ValueError(f"source {to!r} does not exist; available: {', '.join(sorted(self._sources))}")
        if not 0.0 <= rate <= MAX_RATE:
            raise ValueError(f"rate must be 0 to {MAX_RATE:g} Hz")
        self._unsubscribe(to)
        if rate > 0.0:
            self._every(to, 1.0 / rate, asyncio.get_running_loop().time())
        else:
            self._pushing[to] = None

    def _unsubscribe(self, to: str = "truth") -> None:
        timer = self._pushing.pop(to, None)
        if timer is not None:
            timer.cancel()

    def _every(self, name: str, period: float, due: float) -> None:
        loop = asyncio.get_running_loop()
        due = max(due + period, loop.time())  # no burst of events after a delay
        self._pushing[name] = loop.call_at(due, self._every, name, period, due)
        self._push(name)

    def _push(self, name: str) -> None:
        transport = self._writer.transport
        # A slow client misses events.
        if not transport.is_closing() and transport.get_write_buffer_size() < MAX_LINE:
            self._send({"event": name, "data": self._sources[name]()})

    def _send(self, message: dict[str, Any]) -> None:
        self._writer.write(_encoder.encode(message) + b"\n")


def _described(name: str, handler: Handler) -> dict[str, Any]:
    """Return name, parameters (``name``, ``[name]`` or ``name=default``) and summary of a command."""
    takes = []
    for each in inspect.signature(handler).parameters.values():
        if each.default is each.empty:
            takes.append(each.name)
        else:
            value = msgspec.json.encode(each.default).decode()
            takes.append(f"[{each.name}]" if each.default is None else f"{each.name}={value}")
    lines = (handler.__doc__ or "").strip().splitlines()
    return {"name": name, "takes": takes, "text": lines[0] if lines else ""}


def _data(answer: Any, command: str) -> Any:
    if not isinstance(answer, dict) or not answer.get("ok"):
        error = answer.get("error") if isinstance(answer, dict) else "not an answer"
        raise ControlError(f"{command}: {error}")
    return answer.get("data")


class ControlClient:
    """Client of the control channel for asyncio: ``client = await ControlClient.connect("127.0.0.1:4000")``."""

    def __init__(self, address: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.address = address
        self._reader, self._writer = reader, writer
        self._numbers = itertools.count(1)
        self._waiting: dict[int, asyncio.Future[Any]] = {}
        self._listeners: dict[str, Callable[[Any], None]] = {}
        self._closed = asyncio.Event()
        self._task = asyncio.create_task(self._read(), name=f"control {address}")

    @classmethod
    async def connect(cls, address: str, within: float = 10.0) -> Self:
        """Connect. Raise `ControlError` if the fake cannot be reached, `ValueError` for an invalid address."""
        host, port = parse_address(address)
        try:
            async with asyncio.timeout(within):
                reader, writer = await asyncio.open_connection(host, port, limit=MAX_LINE)
        except OSError as e:  # TimeoutError is an OSError
            raise ControlError(f"control channel {address}: {str(e) or 'timed out'}") from e
        return cls(address, reader, writer)

    async def do(self, command: str, within: float = 10.0, **arguments: Any) -> Any:
        """Execute a command and return its data.

        Raise `ControlError` if it is refused, late, or the channel is closed.
        """
        if self._closed.is_set():
            raise ControlError(f"{command}: the control channel {self.address} is closed")
        number = next(self._numbers)
        future = self._waiting[number] = asyncio.get_running_loop().create_future()
        try:
            async with asyncio.timeout(within):
                self._writer.write(_encoder.encode({"id": number, "do": command, **arguments}) + b"\n")
                await self._writer.drain()
                return _data(await future, command)
        except OSError as e:
            raise ControlError(f"{command}: {self.address}: {str(e) or f'no answer in {within:g} s'}") from e
        finally:
            del self._waiting[number]

    async def subscribe(self, listener: Callable[[Any], None], to: str = "truth", rate: float = 0.0) -> None:
        """Call `listener` in the event loop with each value at a rate, Hz; 0: on change."""
        self._listeners[to] = listener
        await self.do("subscribe", to=to, rate=rate)

    async def wait_closed(self) -> None:
        """Wait until the channel is closed by either side."""
        await self._closed.wait()

    async def close(self) -> None:
        """Close the channel. The second call does nothing."""
        self._task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.shield(asyncio.gather(self._task, return_exceptions=True))
        self._writer.close()
        with contextlib.suppress(OSError):
            await self._writer.wait_closed()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def _read(self) -> None:
        try:
            while line := await self._reader.readline():
                message = _decoder.decode(line)
                if "event" in message:
                    listener = self._listeners.get(message["event"])
                    if listener is not None:
                        listener(message.get("data"))
                else:
                    future = self._waiting.get(message.get("id", 0))
                    if future is not None and not future.done():
                        future.set_result(message)
        except (OSError, ValueError):
            pass  # reported below to all pending commands
        finally:
            self._closed.set()
            for future in self._waiting.values():
                if not future.done():
                    future.set_exception(ConnectionResetError("the control channel closed"))


class BlockingControlClient:
    """Client of the control channel for tests: one request at a time, with a time limit. A context manager."""

    def __init__(self, address: str, within: float = 10.0) -> None:
        self.address = address
        self._numbers = itertools.count(1)
        self._buffer = b""
        try:
            self._socket = socket.create_connection(parse_address(address), within)
        except OSError as e:
            raise ControlError(f"control channel {address}: {e}") from e

    def do(self, command: str, within: float = 10.0, **arguments: Any) -> Any:
        """Execute a command and return its data.

        Raise `ControlError` if it is refused, late, or the channel is closed.
        """
        number = next(self._numbers)
        deadline = time.monotonic() + within
        try:
            self._socket.settimeout(within)
            self._socket.sendall(_encoder.encode({"id": number, "do": command, **arguments}) + b"\n")
            while True:
                answer = self._line(deadline)
                if answer.get("id") == number:
                    return _data(answer, command)
        except OSError as e:
            raise ControlError(f"{command}: {self.address}: {e}") from e

    def wait_until(self, holds: Callable[[Any], bool], within: float = 20.0, command: str = "truth") -> Any:
        """Repeat a command until `holds` accepts its data, and return it. Raise `ControlError` after `within` s."""
        deadline = time.monotonic() + within
        while not holds(data := self.do(command)):
            if time.monotonic() > deadline:
                raise ControlError(f"{command}: not as expected within {within:g} s, last {data!r}")
            time.sleep(0.005)
        return data

    def close(self) -> None:
        """Close the channel."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, e: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _line(self, deadline: float) -> dict[str, Any]:
        while b"\n" not in self._buffer:
            self._socket.settimeout(max(deadline - time.monotonic(), 0.001))
            received = self._socket.recv(65536)
            if not received:
                raise ConnectionResetError("the control channel closed")
            self._buffer += received
        line, self._buffer = self._buffer.split(b"\n", 1)
        message = _decoder.decode(line)
        return message if isinstance(message, dict) else {}
