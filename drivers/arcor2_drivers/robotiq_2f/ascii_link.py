"""The URCap's ASCII port: one question at a time, each with its time limit."""

import contextlib
import re
import socket
import threading
import time
from typing import Final

from arcor2_hw.exceptions import ConnectionLost, DeviceFault, DeviceTimeout, NotConnected, Refused

from .status import Activation, Command, Object, Status

LONGEST: Final = 64
"""Bytes: an answer has hardly more than ten."""
_VALUE: Final = re.compile(rb"([A-Z]{3}) ([0-9A-F]{1,3})\r?\n")
_ORDER: Final = ("ACT", "GTO", "STA", "FLT", "PRE", "OBJ", "POS")
"""The object status is asked for after the request it belongs to, so that it is never older."""


class AsciiLink:
    """The connection to one gripper. After a missing or senseless answer it is closed: a late one finds nobody."""

    def __init__(self, name: str, host: str, port: int, request_timeout: float) -> None:
        self.who = f"{name} at {host}:{port}"
        self._address, self._timeout = (host, port), request_timeout
        self._one_question = threading.Lock()
        self._socket: socket.socket | None = None

    def open(self, timeout: float) -> None:
        """Open within `timeout` s. Raises NotConnected, DeviceTimeout."""
        self.close()
        try:
            opened = socket.create_connection(self._address, timeout)
        except TimeoutError as error:
            raise DeviceTimeout(f"{self.who} did not take the connection within {timeout:.1f} s") from error
        except (OSError, UnicodeError) as error:
            raise NotConnected(f"{self.who} cannot be reached", str(error)) from error
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = opened

    def close(self) -> None:
        """Close; harmless when closed."""
        opened = self._socket
        if opened is not None:
            with contextlib.suppress(OSError):  # the other end was quicker
                opened.shutdown(socket.SHUT_RDWR)  # wakes the thread that waits in it
        with self._one_question:
            self._close()

    def read(self) -> Status:
        """Ask for all variables, one after the other. Raises DeviceTimeout, ConnectionLost, DeviceFault."""
        told = {name: self._get(name) for name in _ORDER}
        try:
            return Status(
                act=bool(told["ACT"]),
                go_to=bool(told["GTO"]),
                activation=Activation(told["STA"]),
                object=Object(told["OBJ"]),
                fault=told["FLT"] & 0x0F,
                echo=told["PRE"],
                position=told["POS"],
            )
        except ValueError as error:
            raise DeviceFault(f"{self.who} tells what no gripper of this kind tells: {error}") from error

    def write(self, command: Command) -> None:
        """Set variables in one line. Raises Refused naming the answer, DeviceTimeout, ConnectionLost."""
        values = {
            "ACT": int(command.act),
            "GTO": int(command.go_to),
            "SPE": command.speed,
            "FOR": command.force,
            "POS": command.position,
        }
        line = " ".join(["SET", *(f"{name} {value}" for name, value in values.items() if value is not None)])
        answer = self._ask(line, re.compile(rb"ack"))
        if answer is None:
            raise Refused(f"{self.who} refuses {line}")

    def _get(self, name: str) -> int:
        found = self._ask(f"GET {name}", _VALUE)
        if found is None:
            raise DeviceFault(f"{self.who} does not know the variable {name}")
        told, value = found[1].decode(), found[2].decode()
        number = int(value, 16 if any(c in "ABCDEF" for c in value) else 10)  # FLT may come as two hex digits
        if told != name or number > 255:
            with self._one_question:
                self._close()
            raise DeviceFault(f"{self.who} answers {told} {value} when asked for {name}")
        return number

    def _ask(self, line: str, expected: re.Pattern[bytes]) -> re.Match[bytes] | None:
        """Give the answer; None when the gripper says that it refuses or does not know."""
        with self._one_question:
            opened = self._socket
            if opened is None:
                raise NotConnected(f"{self.who} is not connected")
            deadline = time.monotonic() + self._timeout
            try:
                opened.settimeout(self._timeout)
                opened.sendall(line.encode("ascii") + b"\n")
                came = b""
                while True:
                    opened.settimeout(max(deadline - time.monotonic(), 0.001))
                    more = opened.recv(LONGEST)
                    if not more:
                        raise ConnectionResetError("closed by the other end")
                    # An acknowledgement may or may not have been followed by the end of its line.
                    came = (came + more).lstrip(b"\r\n ")
                    if (found := expected.fullmatch(came.rstrip(b"\r\n") if came.startswith(b"ack") else came)) is None:
                        if came.rstrip(b"\r\n") in (b"?", b"nack"):
                            return None
                        if came.endswith(b"\n") or len(came) > LONGEST or not came.isascii():
                            self._close()
                            raise DeviceFault(f"{self.who}: what came is no valid answer to {line}", repr(came[:32]))
                        continue
                    return found
            except TimeoutError as error:
                self._close()
                raise DeviceTimeout(
                    f"{self.who} did not answer {line} within {self._timeout:g} s", repr(came[:32])
                ) from error
            except OSError as error:
                self._close()
                raise ConnectionLost(f"{self.who}: the connection was lost", str(error)) from error

    def _close(self) -> None:
        opened, self._socket = self._socket, None
        if opened is not None:
            opened.close()
