"""Calls between two processes over a socket: nested in each other, and concurrent.

A call is served by the thread that waits for the call it is part of, so a call back runs on the thread (and the lane)
where it would run within one process. Any other call is served by a thread that belongs to the calling thread: calls of
one lane are served in order by one thread, calls of different lanes by different threads.
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

LARGEST: Final = 1 << 30
"""Bytes of one message; a picture of 12 megapixels with depth has 60 million."""
COPIED: Final = 1 << 16
"""Bytes of a payload from which it is sent apart from its header, to spare a copy."""
IDLE: Final = 60.0
"""Seconds after which a thread that serves calls ends when no call came."""

log = logging.getLogger(__name__)


class Kind(enum.IntEnum):
    """What a message is."""

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
    """What a message starts with; the payload follows.

    Attributes:
        number: Of the call, counted by the caller.
        thread: Caller's thread.
        within: Number of the call of the other process that the caller is serving, 0 for none.
        target: Number of the object, counted by the process that has it.
        name: Method or attribute; empty to call the object itself.
    """

    kind: Kind
    number: int = 0
    thread: int = 0
    within: int = 0
    target: int = 0
    name: str = ""


class Message(msgspec.Struct):
    """A received message. `epoch` is for the process that serves it."""

    header: Header
    payload: bytes
    epoch: int = 0


_encode: Final = msgspec.msgpack.Encoder().encode
_decode: Final = msgspec.msgpack.Decoder(Header).decode


class Peer:
    """One end of the connection. Subclasses override the methods below "to override".

    Args:
        sock: Connected stream socket.
        idle: Seconds after which a serving thread ends; None: never.
    """

    def __init__(self, sock: socket.socket, idle: float | None = IDLE) -> None:
        self.codec = Codec(self._stub)
        self._socket = sock
        self._idle = idle
        self._sending = threading.Lock()
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()
        self._boxes: dict[int, SimpleQueue[Message | None]] = {}
        """Of the calls that wait for an answer, by number."""
        self._workers: dict[int, SimpleQueue[Message | None]] = {}
        """Of the threads that serve, by the caller's thread."""
        self._closed = False
        self._here = threading.local()
        self._stubs: dict[int, Any] = {}

    # -------------------------------------------------------------------------------- to override
    def arrived(self, message: Message) -> None:
        """Note a call, in the order of arrival. On the reader's thread; must not block."""

    def execute(self, message: Message) -> Any:
        """Do what a call asks for and return the result."""
        return self.perform(message)

    def notified(self, message: Message) -> None:
        """Take a message that is no call. On the reader's thread; must not block."""

    def flush(self) -> None:
        """Send what the other process has to know before the next call or answer."""

    def lost(self) -> Arcor2Error:
        """Return the error of a call that cannot be answered because the other process has ended."""
        return ConnectionLost("the connection between two processes ended")

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
        """Send a request and wait for the answer, meanwhile serving what is called back as part of it.

        There is no deadline here: whoever calls on a lane has the lane's, and the end of the process ends the wait.
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
        """Send a message. Raises OSError when the connection has ended."""
        head = framed(_encode(header))
        start = prefix(len(head) + len(payload)) + head
        with self._sending:
            if len(payload) < COPIED:
                self._socket.sendall(start + payload)
            else:
                self._socket.sendall(start)
                self._socket.sendall(payload)

    # -------------------------------------------------------------------------------- reading
    def receive(self) -> None:
        """Read messages until the connection ends, then fail what waits for an answer."""
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
            log.exception("The connection to another process is out of step and counts as lost.")
        with self._lock:
            self._closed = True
            waiting = [*self._boxes.values(), *self._workers.values()]
        for each in waiting:
            each.put(None)

    def _next(self) -> Message | None:
        start = self._take(PREFIX_SIZE)
        if start is None:
            return None
        body = self._take(body_length(bytes(start), LARGEST))
        if body is None:
            return None
        end = PREFIX_SIZE + body_length(bytes(body[:PREFIX_SIZE]), len(body))
        return Message(_decode(body[PREFIX_SIZE:end]), bytes(body[end:]))

    def _take(self, size: int) -> memoryview | None:
        """Return the next bytes of the stream, None at its end."""
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
            except BaseException as error:  # noqa: BLE001 - whatever is raised belongs to the caller
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
            raise InvalidData("{type!r} is no request", type=header.kind)
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
        """Have `stub` stand for the object of the other process with that number."""
        with self._lock:
            self._stubs[number] = stub
