"""A relay between a Modbus TCP host and its device that counts requests and can delay or falsify an answer."""

import collections
import contextlib
import socket
import threading
import time
from types import TracebackType
from typing import Self

_HEADER = 7


def _read(source: socket.socket) -> bytes:
    """Read one Modbus TCP frame; return nothing if the other end has closed."""
    data = b""
    while len(data) < _HEADER or len(data) < 6 + int.from_bytes(data[4:6], "big"):
        more = source.recv(512)
        if not more:
            return b""
        data += more
    return data


class Relay:
    """Listens on `address`; serves each connection in its own thread, one request at a time."""

    def __init__(self, device: str) -> None:
        host, _, port = device.rpartition(":")
        self._device = host, int(port)
        self._server = socket.create_server(("127.0.0.1", 0))
        self.address = "{}:{}".format(*self._server.getsockname())
        self.connections = 0
        self.requests: collections.Counter[int] = collections.Counter()
        self._delays: dict[int, float] = {}
        self._renumber: set[int] = set()
        self._last: dict[int, bytes] = {}
        self._repeated: dict[int, bytes] = {}
        self._threads: list[threading.Thread] = []
        self._sockets: list[socket.socket] = []

    def delay_next(self, function: int, seconds: float) -> None:
        """Delay the next answer with this function code."""
        self._delays[function] = seconds

    def renumber_next(self, function: int) -> None:
        """Change the transaction number of the next answer with this function code."""
        self._renumber.add(function)

    def repeat_last(self, function: int) -> None:
        """From now on answer each request with this function code with the last answer."""
        self._repeated[function] = self._last[function]

    def __enter__(self) -> Self:
        self._start(self._accept)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for each in (self._server, *self._sockets):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join(30.0)
        for each in (self._server, *self._sockets):
            each.close()

    def _start(self, target: object, *args: object) -> None:
        thread = threading.Thread(target=target, args=args)  # type: ignore[arg-type]
        self._threads.append(thread)
        thread.start()

    def _accept(self) -> None:
        while True:
            try:
                host, _ = self._server.accept()
            except OSError:
                return
            device = socket.create_connection(self._device)
            self._sockets += [host, device]
            self.connections += 1
            self._start(self._serve, host, device)

    def _serve(self, host: socket.socket, device: socket.socket) -> None:
        try:
            while request := _read(host):
                function = request[_HEADER]
                self.requests[function] += 1
                device.sendall(request)
                answer = self._last[function] = _read(device)
                if function in self._repeated:
                    answer = request[:2] + self._repeated[function][2:]
                time.sleep(self._delays.pop(function, 0.0))
                if function in self._renumber:
                    self._renumber.discard(function)
                    answer = bytes([answer[0] ^ 1]) + answer[1:]
                host.sendall(answer)
        except OSError:
            pass  # the other end has closed
        finally:
            device.close()
