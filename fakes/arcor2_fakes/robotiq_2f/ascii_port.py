"""ASCII port of the URCap: lines `GET <variable>` and `SET <variable> <value> ...`."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final

from arcor2_fakes.robotiq_2f.gripper import REQUESTS, Gripper
from arcor2_fakes.wire import Connection, TcpWire

READABLE: Final = (*REQUESTS, "STA", "OBJ", "FLT", "PRE", "COU")
_LIMITS: Final = {"ACT": 1, "GTO": 1, "ATR": 1, "ARD": 1}
_LONGEST: Final = 256
_UNIT: Final = 9


class AsciiPort:
    """Serves any number of clients on a TCP port."""

    def __init__(self, host: str, port: int, gripper: Gripper) -> None:
        self._gripper = gripper
        self.wire = TcpWire("ascii", host, port, self._opened)
        self.received: deque[str] = deque(maxlen=200)
        self.sets: deque[str] = deque(maxlen=50)

    def _opened(self, connection: Connection) -> None:
        connection.received = _Lines(lambda line: connection.send(self._answer(line)), connection.close).feed

    def _answer(self, line: str) -> bytes:
        self.received.append(line)
        verb, *words = line.split() or [""]
        if verb == "GET" and len(words) == 1:
            if words[0] == "SID":
                return f"[{_UNIT}]\n".encode()
            if words[0] in READABLE:
                return f"{words[0]} {self._gripper.registers()[words[0]]}\n".encode()
        elif verb == "SET" and words and len(words) % 2 == 0:
            self.sets.append(line)
            changes: dict[str, int] = {}
            for name, value in zip(words[::2], words[1::2], strict=True):
                if name not in REQUESTS or not value.isdigit() or int(value) > _LIMITS.get(name, 255):
                    return b"nack"
                changes[name] = int(value)
            self._gripper.request(changes)
            return b"ack"
        return b"?\n"


class _Lines:
    """Splits the bytes of a client into lines."""

    def __init__(self, line: Callable[[str], object], close: Callable[[], None]) -> None:
        self._line, self._close = line, close
        self._rest = b""

    def feed(self, data: bytes) -> None:
        *complete, self._rest = (self._rest + data).split(b"\n")
        for raw in complete:
            self._line(raw.decode("ascii", "replace").strip())
        if len(self._rest) > _LONGEST:
            self._close()
