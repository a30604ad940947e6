"""The dashboard server, port 29999: one line of text out, one line back, each with its deadline.

Source: Universal Robots, "Dashboard Server, e-Series". Beside the library's own client because that one bounds no wait
by the caller's deadline, and a stop must not queue behind a question: every `Dashboard` is a connection of its own.
"""

import contextlib
import re
import socket
import threading
import time

from arcor2_hw.data.robot import Mode, ProgramState
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, NotConnected, Refused

PORT = 29999
MAX_LINE = 4096  # the longest honest answer names a file


def is_remote(answer: str) -> bool:
    """Read the answer to `is in remote control`; DeviceFault when it is none."""
    word = answer.strip().lower()
    if word not in ("true", "false"):
        raise DeviceFault("the controller's answer on remote control makes no sense", answer)
    return word == "true"


def operational_mode(answer: str, remote: bool) -> Mode:
    """Read the answer to `get operational mode`; a controller without modes (CB3, no password set) gives OTHER."""
    word = answer.strip().upper()
    if word == "MANUAL":
        return Mode.MANUAL_REDUCED_SPEED
    if word == "AUTOMATIC":
        return Mode.AUTOMATIC_EXTERNAL if remote else Mode.AUTOMATIC
    return Mode.OTHER


_STATES = {"STOPPED": ProgramState.STOPPED, "PLAYING": ProgramState.PLAYING, "PAUSED": ProgramState.PAUSED}


def program(answer: str) -> tuple[ProgramState, str]:
    """Read the answer to `programState`, "PLAYING name.urp": state and name; DeviceFault when it is none."""
    word, _, name = answer.strip().partition(" ")
    if word.upper() not in _STATES:
        raise DeviceFault("the controller's answer on its program makes no sense", answer)
    return _STATES[word.upper()], name.strip()


def version(answer: str) -> str:
    """Read the version x.y.z or x.y.z.w out of the answer to `PolyscopeVersion`, "" when there is none."""
    found = re.search(r"\d+\.\d+\.\d+(?:\.\d+)?", answer, re.ASCII)
    return found[0] if found else ""


class Dashboard:
    """One connection to the dashboard server, opened when first used; safe to call from several threads."""

    def __init__(self, host: str, port: int = PORT) -> None:
        self.address = f"{host}:{port}"
        self._where = (host, port)
        self._lock = threading.Lock()
        self._socket: socket.socket | None = None
        self._buffer = b""

    def open(self, timeout: float) -> None:
        """Connect and take the greeting; harmless when open. Raises NotConnected, DeviceTimeout, ConnectionLost."""
        deadline = time.monotonic() + timeout
        with self._held(deadline):
            self._opened(deadline)

    def ask(self, command: str, timeout: float = 1.0) -> str:
        """Send a command, give the answer. After an error the connection is closed, so no late answer is taken."""
        deadline = time.monotonic() + timeout
        with self._held(deadline):
            opened = self._opened(deadline)
            try:
                opened.settimeout(max(deadline - time.monotonic(), 0.001))
                opened.sendall(command.encode("ascii") + b"\n")
                return self._line(deadline)
            except TimeoutError:
                self._shut()
                raise DeviceTimeout(f"dashboard {self.address} did not answer {command!r} in {timeout:g} s") from None
            except OSError as e:
                self._shut()
                raise ConnectionLost(f"dashboard {self.address} closed the connection", f"{command!r}: {e}") from e

    def do(self, command: str, expected: str, timeout: float = 1.0) -> None:
        """Give an order; Refused with the controller's words when the answer is another than expected."""
        answer = self.ask(command, timeout)
        if not answer.startswith(expected):
            raise Refused(f"the controller refuses {command!r}: {answer}", f"dashboard {self.address}")

    def close(self) -> None:
        """Close; harmless when closed. A question under way in another thread fails."""
        open_socket = self._socket
        if open_socket is not None:
            with contextlib.suppress(OSError):
                open_socket.shutdown(socket.SHUT_RDWR)
        with self._lock:
            self._shut()

    @contextlib.contextmanager
    def _held(self, deadline: float):  # type: ignore[no-untyped-def]
        if not self._lock.acquire(timeout=max(deadline - time.monotonic(), 0.0)):
            raise DeviceTimeout(f"dashboard {self.address} is busy with another question")
        try:
            yield
        finally:
            self._lock.release()

    def _opened(self, deadline: float) -> socket.socket:
        if self._socket is not None and self._quiet(self._socket):
            return self._socket
        self._shut()
        try:
            self._socket = socket.create_connection(self._where, max(deadline - time.monotonic(), 0.001))
            self._line(deadline)  # the greeting
        except TimeoutError:
            self._shut()
            raise DeviceTimeout(f"dashboard {self.address} does not answer") from None
        except OSError as e:
            self._shut()
            raise NotConnected(f"no dashboard server at {self.address}", str(e)) from e
        return self._socket

    def _quiet(self, opened: socket.socket) -> bool:
        """Tell whether the connection is open with nothing unasked in it: one that broke while idle is replaced."""
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
                raise ConnectionError("an answer without end")
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


def absent(error: DeviceError) -> bool:
    """Tell whether there is no dashboard server at all, as on PolyScope X."""
    return isinstance(error, NotConnected)
