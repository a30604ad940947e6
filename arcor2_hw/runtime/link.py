"""The cell host's end of the socket to the server: a writer thread, and a reader that signals can wake."""

import select
import signal
import socket
import threading
import time
from collections.abc import Iterator
from queue import Empty, SimpleQueue
from typing import Any, Final

from arcor2_hw.runtime.messages import (
    PREFIX_SIZE,
    Alive,
    HostBound,
    LogLine,
    StreamEvent,
    ToServer,
    body_length,
    decode_host_bound,
    encode,
)

STREAM_BACKLOG: Final = 1000
"""Number of queued messages above which streamed values are dropped."""
BACKLOG: Final = 4096
"""Number of queued messages above which a program waits before its next event."""
_CHUNK: Final = 1 << 18
_ROOM_POLL: Final = 0.002
"""Period at which the number of queued messages is checked, s."""


class Link:
    """Send messages to the server and receive its messages."""

    def __init__(self, sock: socket.socket) -> None:
        self._socket = sock
        self._socket.setblocking(True)
        self._outbox: SimpleQueue[ToServer | None] = SimpleQueue()
        self._sent = 0
        self._writer = threading.Thread(target=self._write, name="to server", daemon=True)
        self._writer.start()

    # -------------------------------------------------------------------------------- out
    def post(self, message: ToServer) -> None:
        """Queue a message. Does not block or raise."""
        self._outbox.put(message)

    def post_stream(self, message: StreamEvent) -> None:
        """Queue a streamed value, or drop it if the server does not keep up."""
        if self._outbox.qsize() < STREAM_BACKLOG:
            self._outbox.put(message)

    def wait_for_room(self, timeout: float) -> None:
        """Wait while the queue is too long, at most `timeout` s, so that a hanging server does not block a program."""
        if self._outbox.qsize() < BACKLOG:
            return
        deadline = time.monotonic() + timeout
        while self._outbox.qsize() >= BACKLOG and time.monotonic() < deadline:
            time.sleep(_ROOM_POLL)

    def close(self, timeout: float) -> None:
        """Send the queued messages. Return early if the server reads nothing for `timeout` s."""
        self._outbox.put(None)
        sent = -1
        while self._writer.is_alive() and sent != self._sent:
            sent = self._sent
            self._writer.join(timeout)

    def _write(self) -> None:
        alive = True
        while (message := self._outbox.get()) is not None:
            batch = [encode(message)]
            last = False
            while len(batch) < 256:
                try:
                    more = self._outbox.get_nowait()
                except Empty:
                    break
                if more is None:
                    last = True
                    break
                batch.append(encode(more))
            if alive:
                try:
                    self._socket.sendall(b"".join(batch))
                    self._sent += len(batch)
                except OSError:
                    alive = False  # the reader ends too; further messages are dropped
            if last:
                return

    # -------------------------------------------------------------------------------- in
    def messages(self, wake: socket.socket) -> Iterator[HostBound]:
        """Yield the messages of the server until it closes the connection or SIGTERM arrives on `wake`.

        They also end when nothing was received for the time of the last `Alive`. A message that waits in the socket
        because this process was delayed counts as received.
        """
        buffer = bytearray()
        silence: float | None = None
        received_at = time.monotonic()
        poll = select.poll()
        poll.register(self._socket, select.POLLIN)
        poll.register(wake, select.POLLIN)
        while True:
            left = None if silence is None else 1e3 * max(0.0, received_at + silence - time.monotonic())
            found = poll.poll(left)
            if not found:
                self.post(LogLine("error", f"the node service hangs: nothing was received for {silence} s"))
                return
            for descriptor, _ in found:
                if descriptor == wake.fileno():
                    if signal.SIGTERM in wake.recv(256):
                        return
                    continue
                try:
                    chunk = self._socket.recv(_CHUNK)
                except OSError:
                    return
                if not chunk:
                    return
                buffer += chunk
                received_at = time.monotonic()
                for message in _take_messages(buffer):
                    if isinstance(message, Alive):
                        silence = message.silence
                    else:
                        yield message


def _take_messages(buffer: bytearray) -> Iterator[Any]:
    """Remove all complete messages from the start of a buffer and yield them."""
    while len(buffer) >= PREFIX_SIZE:
        end = PREFIX_SIZE + body_length(bytes(buffer[:PREFIX_SIZE]))
        if len(buffer) < end:
            return
        body = bytes(buffer[PREFIX_SIZE:end])
        del buffer[:end]
        yield decode_host_bound(body)
