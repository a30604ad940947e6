"""The dashboard server, port 29999: one line of text per command, one line per answer, each with a deadline.

Source: Universal Robots, "Dashboard Server, e-Series". The library's own client is not used: its waits have no deadline
that the caller sets, and a stop must not queue behind another command. Every `Dashboard` is a separate connection.
"""

import contextlib
import re
import socket
import threading
import time
from collections.abc import Iterator

from arcor2_hw.data.robot import Mode
from arcor2_hw.exceptions import DeviceError, DeviceFault, DeviceTimeout, Refused
from arcor2_hw.messages import Message

from .sockets import connect, exchange

PORT = 29999
NAME = Message.of("dashboard server")
"""Name of the port in errors."""
MAX_LINE = 4096
"""Maximum length of an answer, bytes: the longest ones contain a file name."""


def is_remote(answer: str) -> bool:
    """Decode the answer to `is in remote control`. Raise DeviceFault if it is invalid."""
    word = answer.strip().lower()
    if word not in ("true", "false"):
        raise DeviceFault("The controller's answer to 'is in remote control' is not valid.", answer)
    return word == "true"


def operational_mode(answer: str, remote: bool) -> Mode:
    """Decode the answer to `get operational mode`; a controller without modes (CB3, no password set) returns OTHER."""
    word = answer.strip().upper()
    if word == "MANUAL":
        return Mode.MANUAL_REDUCED_SPEED
    if word == "AUTOMATIC":
        return Mode.AUTOMATIC_EXTERNAL if remote else Mode.AUTOMATIC
    return Mode.OTHER


def program_name(answer: str) -> str:
    """Return the name in the answer to `programState`, "PLAYING name.urp". Raise DeviceFault if it is invalid."""
    word, _, name = answer.strip().partition(" ")
    if word.upper() not in ("STOPPED", "PLAYING", "PAUSED"):
        raise DeviceFault("The controller's answer to 'programState' is not valid.", answer)
    return name.strip()


def version(answer: str) -> str:
    """Return the version x.y.z or x.y.z.w in the answer to `PolyscopeVersion`, or an empty string."""
    found = re.search(r"\d+\.\d+\.\d+(?:\.\d+)?", answer, re.ASCII)
    return found[0] if found else ""


class Dashboard:
    """One connection to the dashboard server, opened on first use. Thread-safe."""

    def __init__(self, host: str, port: int = PORT) -> None:
        self.address = f"{host}:{port}"
        self._host, self._port = host, port
        self._lock = threading.Lock()
        self._socket: socket.socket | None = None
        self._buffer = b""

    def open(self, timeout: float) -> None:
        """Connect and read the greeting, if not connected. Raise NotConnected, DeviceTimeout or ConnectionLost."""
        deadline = time.monotonic() + timeout
        with self._locked(deadline):
            self._connected(deadline)

    def ask(self, command: str, timeout: float = 1.0) -> str:
        """Send a command and return the answer.

        After an error the connection is closed, so that a late answer is discarded.
        """
        deadline = time.monotonic() + timeout
        with self._locked(deadline):
            opened = self._connected(deadline)
            try:
                with exchange(NAME, self.address, timeout, command):
                    opened.settimeout(max(deadline - time.monotonic(), 0.001))
                    opened.sendall(command.encode("ascii") + b"\n")
                    return self._line(deadline)
            except DeviceError:
                self._shut()
                raise

    def do(self, command: str, expected: str, timeout: float = 1.0) -> None:
        """Send a command. Raise Refused, with the controller's text, for an answer other than `expected`."""
        answer = self.ask(command, timeout)
        if not answer.startswith(expected):
            raise Refused(
                "The controller refuses {command!r}: {answer}",
                f"dashboard {self.address}",
                command=command,
                answer=answer,
            )

    def close(self) -> None:
        """Close the connection; a command in progress on another thread fails."""
        open_socket = self._socket
        if open_socket is not None:
            with contextlib.suppress(OSError):
                open_socket.shutdown(socket.SHUT_RDWR)
        with self._lock:
            self._shut()

    @contextlib.contextmanager
    def _locked(self, deadline: float) -> Iterator[None]:
        if not self._lock.acquire(timeout=max(deadline - time.monotonic(), 0.0)):
            raise DeviceTimeout("Dashboard {address} is busy with another command.", address=self.address)
        try:
            yield
        finally:
            self._lock.release()

    def _connected(self, deadline: float) -> socket.socket:
        if self._socket is not None and self._is_idle(self._socket):
            return self._socket
        self._shut()
        left = max(deadline - time.monotonic(), 0.001)
        self._socket = connect(NAME, self._host, self._port, left)
        try:
            with exchange(NAME, self.address, left):
                self._line(deadline)  # the greeting
        except DeviceError:
            self._shut()
            raise
        return self._socket

    def _is_idle(self, opened: socket.socket) -> bool:
        """Return whether the connection is open and nothing unexpected was received on it."""
        try:
            opened.settimeout(0.0)
            opened.recv(1, socket.MSG_PEEK)
        except BlockingIOError:
            return not self._buffer
        except OSError:
            return False
        return False

    def _line(self, deadline: float) -> str:
        assert self._socket is not None
        while b"\n" not in self._buffer:
            if len(self._buffer) > MAX_LINE:
                raise ConnectionError("the answer is too long")
            self._socket.settimeout(max(deadline - time.monotonic(), 0.001))
            data = self._socket.recv(MAX_LINE)
            if not data:
                raise ConnectionError("closed by the controller")
            self._buffer += data
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line.decode("utf-8", "replace").strip()

    def _shut(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        self._buffer = b""
