"""Nested and concurrent calls between two processes over a socket.

A nested call is served by the thread that waits for the outer call, so that it runs on the same thread (and lane) as
within one process. Each thread of the caller has its own thread here for its outer calls: calls of one lane are served
in order, calls of different lanes concurrently.
"""

import enum
import itertools
import logging
import socket
import threading
from queue import Empty, SimpleQueue
from typing import Any, Final

import msgspec

from arcor2_hw.exceptions import Arcor2Error, ConnectionLost, InvalidData
from arcor2_hw.framing import PREFIX_SIZE, body_length, framed, prefix
from arcor2_hw.runtime.own_process.pickling import Codec, Description
from arcor2_hw.runtime.own_process.stubs import stub_of

MAX_MESSAGE: Final = 1 << 30
"""Maximum length of a message, bytes. A picture of 12 megapixels with depth has 60 million."""
SEPARATE_PAYLOAD: Final = 1 << 16
"""Size above which a payload is sent separately from its header, without a copy, bytes."""
IDLE_TIMEOUT: Final = 60.0
"""Time after which an idle serving thread ends, s."""

log = logging.getLogger(__name__)


class Kind(enum.IntEnum):
    """Kind of a message."""

    CALL = 0
    READ = 1
    """Read an attribute."""
    WRITE = 2
    """Set an attribute."""
    REPLY = 3
    ERROR = 4
    STATE = 5
    LOG = 6


class Header(msgspec.Struct, array_like=True, frozen=True):
    """Header of a message, which is followed by the payload.

    Attributes:
        number: Of the call, assigned by the caller.
        thread: Caller's thread.
        within: Number of the outer call, which the caller is serving; 0 for none.
        target: Number of the object, assigned by its process.
        name: Method or attribute; empty to call the object itself.
    """

    kind: Kind
    number: int = 0
    thread: int = 0
    within: int = 0
    target: int = 0
    name: str = ""


class Message(msgspec.Struct):
    """A received message. `epoch` is set by the process that serves it."""

    header: Header
    payload: bytes
    epoch: int = 0


_encode: Final = msgspec.msgpack.Encoder().encode
_decode: Final = msgspec.msgpack.Decoder(Header).decode


class Peer:
    """One end of the connection. Subclasses override the methods below "to override".

    Args:
        sock: Connected stream socket.
        idle: Time after which an idle serving thread ends, s; None to keep it.
    """

    def __init__(self, sock: socket.socket, idle: float | None = IDLE_TIMEOUT) -> None:
        self.codec = Codec(self._stub)
        self._socket = sock
        self._idle = idle
        self._sending = threading.Lock()
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()
        self._boxes: dict[int, SimpleQueue[Message | None]] = {}
        """Queues of the threads that wait for an answer, by number of the call."""
        self._workers: dict[int, SimpleQueue[Message | None]] = {}
        """Queues of the serving threads, by thread of the caller."""
        self._closed = False
        self._here = threading.local()
        self._stubs: dict[int, Any] = {}

    # -------------------------------------------------------------------------------- to override
    def arrived(self, message: Message) -> None:
        """Record a call in the order of arrival. Runs on the reader thread and must not block."""

    def execute(self, message: Message) -> Any:
        """Serve a call and return the result."""
        return self.perform(message)

    def notified(self, message: Message) -> None:
        """Handle a message that is not a call. Runs on the reader thread and must not block."""

    def flush(self) -> None:
        """Send pending state before the next call or answer."""

    def lost(self) -> Arcor2Error:
        """Return the error of a call that has no answer because the other process has ended."""
        return ConnectionLost("the connection to the process of the device has ended")

    # -------------------------------------------------------------------------------- calls
    def call(self, target: int, name: str, arguments: tuple[Any, ...], keywords: dict[str, Any]) -> Any:
        """Call a method of an object of the other process and return the result, or raise its error."""
        return self.request(Kind.CALL, target, name, self.codec.encode((arguments, keywords)))

    def read(self, target: int, name: str) -> Any:
        """Return an attribute of an object of the other process."""
        return self.request(Kind.READ, target, name)

    def write(self, target: int, name: str, value: Any) -> None:
        """Set an attribute of an object of the other process."""
        self.request(Kind.WRITE, target, name, self.codec.encode(value))

    def request(self, kind: Kind, target: int, name: str, payload: bytes = b"") -> Any:
        """Send a request, serve the nested calls of the other process, and return its answer.

        There is no deadline: the lane of the caller has one, and the end of the other process ends the wait.
        """
        box: SimpleQueue[Message | None] = SimpleQueue()
        number = next(self._numbers)
        with self._lock:
            if self._closed:
                raise self.lost()
            self._boxes[number] = box
        within = getattr(self._here, "serving", 0)
        try:
            self.flush()
            self.send(Header(kind, number, threading.get_ident(), within, target, name), payload)
            while (message := box.get()) is not None:
                if message.header.kind is Kind.REPLY:
                    return self.codec.decode(message.payload)
                if message.header.kind is Kind.ERROR:
                    raise self.codec.decode_error(message.payload)
                self._serve(message)
        except OSError:
            pass
        finally:
            with self._lock:
                self._boxes.pop(number, None)
        raise self.lost()

    def send(self, header: Header, payload: bytes = b"") -> None:
        """Send a message. Raises OSError if the connection has ended."""
        head = framed(_encode(header))
        start = prefix(len(head) + len(payload)) + head
        with self._sending:
            if len(payload) < SEPARATE_PAYLOAD:
                self._socket.sendall(start + payload)
            else:
                self._socket.sendall(start)
                self._socket.sendall(payload)

    # -------------------------------------------------------------------------------- reading
    def receive(self) -> None:
        """Read messages until the connection ends, then fail all calls that wait for an answer."""
        try:
            while (message := self._next()) is not None:
                match message.header.kind:
                    case Kind.REPLY | Kind.ERROR:
                        with self._lock:
                            box = self._boxes.get(message.header.number)
                        if box is not None:
                            box.put(message)
                    case Kind.STATE | Kind.LOG:
                        self.notified(message)
                    case _:
                        self.arrived(message)
                        self._dispatch(message)
        except OSError:
            pass
        except Exception:
            log.exception("Received an invalid message from another process. Its connection is closed.")
        with self._lock:
            self._closed = True
            waiting = [*self._boxes.values(), *self._workers.values()]
        for each in waiting:
            each.put(None)

    def _next(self) -> Message | None:
        start = self._take(PREFIX_SIZE)
        if start is None:
            return None
        body = self._take(body_length(bytes(start), MAX_MESSAGE))
        if body is None:
            return None
        end = PREFIX_SIZE + body_length(bytes(body[:PREFIX_SIZE]), len(body))
        return Message(_decode(body[PREFIX_SIZE:end]), bytes(body[end:]))

    def _take(self, size: int) -> memoryview | None:
        """Return the next bytes of the stream, or None at its end."""
        found = memoryview(bytearray(size))
        filled = 0
        while filled < size:
            count = self._socket.recv_into(found[filled:])
            if count == 0:
                return None
            filled += count
        return found

    # -------------------------------------------------------------------------------- serving
    def _dispatch(self, message: Message) -> None:
        header = message.header
        with self._lock:
            queue = self._boxes.get(header.within) if header.within else None
            if queue is None:
                queue = self._workers.get(header.thread)
            if queue is None:
                queue = self._workers[header.thread] = SimpleQueue()
                worker = threading.Thread(target=self._work, args=(header.thread, queue), daemon=True)
                worker.start()
            queue.put(message)

    def _work(self, thread: int, queue: "SimpleQueue[Message | None]") -> None:
        while True:
            try:
                message = queue.get(timeout=self._idle)
            except Empty:
                with self._lock:
                    if queue.empty():
                        del self._workers[thread]
                        return
                continue
            if message is None:
                return
            self._serve(message)

    def _serve(self, message: Message) -> None:
        header = message.header
        outer = getattr(self._here, "serving", 0)
        self._here.serving = header.number
        try:
            try:
                kind, payload = Kind.REPLY, self.codec.encode(self.execute(message))
            except BaseException as error:  # noqa: BLE001 - the caller receives every error
                kind, payload = Kind.ERROR, self.codec.encode_error(error)
            self.flush()
            self.send(Header(kind, header.number), payload)
        except OSError:
            pass  # the caller has ended
        finally:
            self._here.serving = outer

    def perform(self, message: Message) -> Any:
        """Call the method, or read or set the attribute, that a message names."""
        header = message.header
        target = self.codec.exported(header.target)
        if header.kind is Kind.READ:
            return getattr(target, header.name)
        if header.kind is Kind.WRITE:
            return setattr(target, header.name, self.codec.decode(message.payload))
        if header.kind is not Kind.CALL:
            raise InvalidData("{type!r} is not a request", type=header.kind)
        arguments, keywords = self.codec.decode(message.payload)
        return (getattr(target, header.name) if header.name else target)(*arguments, **keywords)

    # -------------------------------------------------------------------------------- stubs
    def _stub(self, description: Description) -> Any:
        number = description.number
        with self._lock:
            if number not in self._stubs:
                self._stubs[number] = stub_of(self, description)
            return self._stubs[number]

    def adopt(self, number: int, stub: Any) -> None:
        """Register the stub of an object of the other process."""
        with self._lock:
            self._stubs[number] = stub
