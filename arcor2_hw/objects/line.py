"""A byte stream to a device over a serial port or a TCP socket, with one request at a time."""

import contextlib
import select
import socket
import threading
import urllib.parse
from collections.abc import Callable, Iterator
from typing import Any, Final, Protocol, TypeVar

from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, NotConnected, Refused
from arcor2_hw.keep_alive import RunningTime
from arcor2_hw.messages import Message
from arcor2_hw.objects.settings import check_serial_port

T = TypeVar("T")

READ_PERIOD: Final = 0.02
"""Longest time that a read waits for the first byte, s."""
WRITE_TIMEOUT: Final = 0.5
"""Time limit of a write, s. A line that accepts no bytes for that long counts as blocked."""
CHUNK: Final = 4096
"""Maximum number of bytes of one read from a socket."""
MAX_ANSWER: Final = 65536
"""Maximum length of an answer, bytes. Only the end of a longer one is evaluated."""


class Line:
    """A serial port, or a TCP socket given as `socket://host:port`.

    A request without an answer in time breaks the line, and a broken line has to be opened again. A late answer is thus
    never mistaken for the answer to the next request.

    Args:
        who: Name and address of the device, for errors.
        port: Path of the serial port, or `socket://host:port`.
        baud_rate: Bits per second of the serial port.
        answer_timeout: Time in which the device has to answer, s.
        parity: Parity of the serial port: N, E or O.
        stopbits: Number of its stop bits.
        data_bits: Number of its data bits, 7 or 8.
    """

    def __init__(
        self,
        who: str | Message,
        port: str,
        baud_rate: int = 9600,
        answer_timeout: float = 0.5,
        *,
        parity: str = "N",
        stopbits: int = 1,
        data_bits: int = 8,
    ) -> None:
        check_serial_port("port", port)
        self.who = who
        self.answer_timeout = answer_timeout
        self.loss: DeviceError | None = None
        """Error that broke the line; None after it was opened again."""
        self._port = port
        self._format = {"baudrate": baud_rate, "parity": parity, "stopbits": stopbits, "bytesize": data_bits}
        self._open: _Port | None = None
        self._one_user = threading.RLock()

    # -------------------------------------------------------------------------------- life
    def open(self, timeout: float) -> None:
        """Open the line within `timeout` s.

        Raises:
            NotConnected: The port cannot be opened.
            DeviceTimeout: The host does not answer.
        """
        self.close()
        try:
            if self._port.startswith("socket://"):
                self._open = _Socket(self._port, timeout)
            else:
                self._open = _Serial(self._port, self._format)
        except TimeoutError:
            raise DeviceTimeout(
                "{device} cannot be reached within {timeout:.1f} s", device=self.who, timeout=timeout
            ) from None
        except (OSError, ValueError) as error:
            text = (
                "{device}: the port is used by another program"
                if "exclusively" in str(error)
                else "{device}: the port cannot be opened"
            )
            raise NotConnected(text, str(error), device=self.who) from error
        self.loss = None

    def close(self) -> None:
        """Close the line. It does nothing when the line is closed. A request that waits for its answer fails."""
        port, self._open = self._open, None
        if port is not None:
            with contextlib.suppress(OSError):
                port.close()

    @contextlib.contextmanager
    def held(self, patience: float = 0.0) -> Iterator[None]:
        """Lock the line. Raises Refused if it stays locked for `patience` s, by default 4 answer timeouts."""
        if not self._one_user.acquire(timeout=patience or 4.0 * self.answer_timeout):
            raise Refused("{device} is busy with another call", device=self.who)
        try:
            yield
        finally:
            self._one_user.release()

    @contextlib.contextmanager
    def held_if_free(self) -> Iterator[bool]:
        """Lock the line unless another thread holds the lock. The value is whether it was locked."""
        free = self._one_user.acquire(blocking=False)
        try:
            yield free
        finally:
            if free:
                self._one_user.release()

    # -------------------------------------------------------------------------------- bytes
    def send(self, data: bytes) -> None:
        """Send bytes. Raises ConnectionLost, DeviceTimeout, NotConnected."""
        port = self._required()
        try:
            port.write(data)
        except TimeoutError as error:
            raise self.broken(DeviceTimeout("{device} accepts no data", str(error), device=self.who)) from error
        except (OSError, TypeError) as error:
            raise self._lost(error) from error

    def receive(self) -> bytes:
        """Return the received bytes after at most READ_PERIOD s. Raises ConnectionLost, NotConnected."""
        port = self._required()
        try:
            return port.read()
        except (OSError, TypeError) as error:  # pyserial raises TypeError when another thread closes the port
            raise self._lost(error) from error

    def waiting(self) -> bytes:
        """Return unsolicited bytes without waiting. Raises ConnectionLost, NotConnected."""
        port = self._required()
        try:
            has_bytes = port.has_bytes()
        except (OSError, TypeError) as error:
            raise self._lost(error) from error
        return self.receive() if has_bytes else b""

    # -------------------------------------------------------------------------------- requests
    def ask(self, question: bytes, answer: Callable[[bytes], T | None], name: str, timeout: float = 0.0) -> T:
        """Send a request and return the decoded answer.

        Args:
            question: The request. Bytes received before are discarded.
            answer: Decodes all bytes received since; returns None while the answer is incomplete.
            name: Name of the request, for errors.
            timeout: Time in which the device has to answer, s; 0 for that of the line.

        Raises:
            DeviceTimeout: The device did not answer in time. This breaks the line.
            ConnectionLost: The line is broken.
        """
        limit = timeout or self.answer_timeout
        with self.held():
            if (loss := self.loss_again()) is not None:
                raise loss
            self.waiting()
            self.send(question)
            clock, received = RunningTime(), b""
            late = False
            while not late:
                late = clock() >= limit  # read once more, because this process may have been suspended
                if data := self.receive():
                    received = (received + data)[-MAX_ANSWER:]
                    if (found := answer(received)) is not None:
                        return found
        text = (
            "{device} gave no valid answer to {request} within {limit:.3g} s"
            if received
            else "{device} did not answer {request} within {limit:.3g} s"
        )
        raise self.broken(DeviceTimeout(text, repr(received[-200:]), device=self.who, request=name, limit=limit))

    def ask_text(self, question: str, end: bytes = b"\r") -> str:
        """Send a line of ASCII text and return the line of the answer, both without `end`."""

        def first_line(received: bytes) -> str | None:
            return received.split(end, 1)[0].decode("ascii", "replace").strip() if end in received else None

        return self.ask(question.encode("ascii") + end, first_line, question)

    def broken(self, error: DeviceError) -> DeviceError:
        """Store the error that broke the line, and return it."""
        self.loss = self.loss or error
        return error

    def loss_again(self) -> DeviceError | None:
        """Return a new error equal to the one that broke the line."""
        loss = self.loss
        if isinstance(loss, DeviceFault):
            return type(loss)(loss.message, loss.detail, loss.fault_code)
        return None if loss is None else type(loss)(loss.message, loss.detail)

    def _required(self) -> "_Port":
        port = self._open
        if port is None:
            raise self.loss_again() or NotConnected("{device} is not connected", device=self.who)
        return port

    def _lost(self, error: Exception) -> DeviceError:
        text = "{device}: the connection was lost: unplugged, or the port was closed"
        return self.broken(ConnectionLost(text, str(error), device=self.who))


class _Port(Protocol):
    """Interface of a port. Its methods raise OSError when the connection has ended."""

    def read(self) -> bytes: ...

    def has_bytes(self) -> bool: ...

    def write(self, data: bytes) -> None: ...

    def close(self) -> None: ...


class _Socket:
    def __init__(self, url: str, timeout: float) -> None:
        parts = urllib.parse.urlsplit(url)
        self._socket = socket.create_connection((parts.hostname, parts.port), timeout)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def read(self) -> bytes:
        if not self._readable(READ_PERIOD):
            return b""
        if data := self._socket.recv(CHUNK):
            return data
        raise ConnectionResetError("closed by the other end")

    def has_bytes(self) -> bool:
        return self._readable(0.0)

    def write(self, data: bytes) -> None:
        self._socket.settimeout(WRITE_TIMEOUT)
        self._socket.sendall(data)

    def close(self) -> None:
        self._socket.close()

    def _readable(self, timeout: float) -> bool:
        try:
            return bool(select.select([self._socket], [], [], timeout)[0])
        except ValueError as error:  # another thread has closed it
            raise ConnectionResetError("closed") from error


class _Serial:
    def __init__(self, path: str, format_: dict[str, Any]) -> None:
        import serial

        self._too_late = serial.SerialTimeoutException
        self._serial = serial.Serial(path, timeout=READ_PERIOD, write_timeout=WRITE_TIMEOUT, exclusive=True, **format_)

    def read(self) -> bytes:
        data: bytes = self._serial.read(1)
        return data + self._serial.read(self._serial.in_waiting) if data else b""

    def has_bytes(self) -> bool:
        return bool(self._serial.in_waiting)

    def write(self, data: bytes) -> None:
        try:
            self._serial.write(data)
        except self._too_late as error:
            raise TimeoutError(str(error)) from error

    def close(self) -> None:
        self._serial.close()


# Names before version 0.2.
LONGEST_ANSWER = MAX_ANSWER
