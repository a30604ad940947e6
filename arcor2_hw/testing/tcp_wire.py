"""The wire of a TCP device: it listens in place of the device, and forwards each connection of the driver."""

import contextlib
import ipaddress
import selectors
import socket
import struct
import threading
from collections.abc import Sequence
from typing import Final

from arcor2_hw.testing.wire import MAX_HELD, Side, Wire

_RESETS: Final = struct.pack("ii", 1, 0)  # struct linger: on, 0 s: closing sends RST
_CHUNK: Final = 65536
_CONNECT_TIMEOUT: Final = 3.0
"""Time limit of a connection to the device, s."""


class _Link:
    """A connection of the driver and its connection to the device."""

    def __init__(self, number: int, driver: socket.socket, device: socket.socket | None) -> None:
        self.number = number
        self.ends: dict[Side, socket.socket] = {"driver": driver}
        if device is not None:
            self.ends["device"] = device
        self.waiting: dict[Side, bytearray] = {"driver": bytearray(), "device": bytearray()}  # by sender
        self.ended: set[Side] = set()
        self.shut: set[Side] = set()
        self.torn = device is None  # opened while the cable was cut, so the device does not know it

    def end_of(self, by: Side) -> socket.socket | None:
        return self.ends.get("device" if by == "driver" else "driver")


class TcpWire(Wire):
    """A wire to a device at `host` and `ports`. It listens at `listen_at`, on the same ports when they are `fixed`."""

    def __init__(self, host: str, ports: Sequence[int], listen_at: str = "127.0.0.1", fixed: bool = False) -> None:
        super().__init__()
        self._host, self._ports, self._listen_at, self._fixed = host, tuple(ports), listen_at, fixed
        self._listeners: dict[socket.socket, int] = {}
        self._links: dict[socket.socket, tuple[_Link, Side]] = {}
        self._count = self._resets = 0
        self._thread: threading.Thread | None = None

    @property
    def address(self) -> str:
        """Return `host:port` of the first port."""
        return f"{self._listen_at}:{self.ports[0]}"

    @property
    def host(self) -> str:
        """Return the address that it listens on."""
        return self._listen_at

    @property
    def ports(self) -> list[int]:
        """Return the ports that it listens on, in the order of the device's."""
        return [listener.getsockname()[1] for listener in self._listeners]

    # -------------------------------------------------------------------------------- life
    def start(self) -> None:
        """Start to listen and forward."""
        family = socket.AF_INET6 if _is_v6(self._listen_at) else socket.AF_INET
        self._selector = selectors.DefaultSelector()
        self._alarm, alarm = socket.socketpair()
        self._woken = alarm
        self._selector.register(alarm, selectors.EVENT_READ)
        self._ending = False
        try:
            for port in self._ports:
                place = (self._listen_at, port if self._fixed else 0)
                listener = socket.create_server(place, family=family, backlog=16)
                self._listeners[listener] = port
                self._selector.register(listener, selectors.EVENT_READ)
        except OSError:
            self.close()
            raise
        self._thread = threading.Thread(target=self._run, name=f"wire to {self._host}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close the listeners and all connections."""
        if not hasattr(self, "_selector"):
            return
        self._ending = True
        self._wake()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        with self._lock:
            for link in {link for link, _ in self._links.values()}:
                self._drop(link)
            for listener in self._listeners:
                listener.close()
            self._listeners.clear()
        self._selector.close()
        self._alarm.close()
        self._woken.close()
        del self._selector

    def _wake(self) -> None:
        with contextlib.suppress(OSError):
            self._alarm.send(b"!")

    # -------------------------------------------------------------------------------- faults
    def reset(self) -> None:
        """Send RST on all connections, to both ends."""
        with self._lock:
            self._resets += 1
            for link in {link for link, _ in self._links.values()}:
                self._drop(link)

    def _healed(self) -> None:
        for link in {link for link, _ in self._links.values()}:
            # A torn stream cannot be synchronized again. An end that was closed during the cut sends nothing more.
            if link.torn or "driver" in link.ended:
                self._drop(link)
            else:
                self._arm(link)
        self._wake()

    # -------------------------------------------------------------------------------- forwarding
    def _run(self) -> None:
        while not self._ending:
            for key, events in self._selector.select():
                end = key.fileobj
                if not isinstance(end, socket.socket) or end.fileno() < 0:
                    continue  # another thread has closed it
                if end in self._listeners:
                    self._accept(end)
                elif end is self._woken:
                    end.recv(64)
                else:
                    with self._lock:
                        self._move(end, events)

    def _accept(self, listener: socket.socket) -> None:
        resets = self._resets
        try:
            driver, _ = listener.accept()
        except OSError:
            return
        device: socket.socket | None = None
        if not self._cut:
            try:
                device = socket.create_connection((self._host, self._listeners[listener]), _CONNECT_TIMEOUT)
            except OSError:  # a missing device is represented by a reset
                _abort(driver)
                return
        with self._lock:
            self._count += 1
            link = _Link(self._count, driver, device)
            if resets != self._resets:  # opened during the reset, so it is reset like the others
                self._drop(link)
                return
            for side, end in link.ends.items():
                end.setblocking(False)
                with contextlib.suppress(OSError):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._links[end] = link, side
                self._selector.register(end, selectors.EVENT_READ)

    def _move(self, end: socket.socket, events: int) -> None:
        found = self._links.get(end)
        if found is None:
            return
        link, side = found
        try:
            if events & selectors.EVENT_READ:
                self._read(link, side, end)
            if not self._cut:
                self._write(link, "driver")
                self._write(link, "device")
        except OSError:
            if self._cut:  # while the cable is cut, the ends do not affect each other
                link.ended |= {side}
                link.torn = True
            else:
                self._drop(link)
                return
        if {"driver", "device"} <= link.shut or (link.shut and "device" not in link.ends):
            self._drop(link)
        else:
            self._arm(link)

    def _read(self, link: _Link, side: Side, end: socket.socket) -> None:
        data = end.recv(_CHUNK)
        if not data:
            link.ended.add(side)
            if link.torn and side == "driver":  # the device does not know this connection
                link.shut.add(side)
            return
        self._keep(side, link.number, data)
        if side == "device" and not self._cut:
            data, link.torn = self._torn(data)
            if link.torn:
                link.ends["driver"].send(data)
                return
        if not link.torn:
            link.waiting[side] += data

    def _write(self, link: _Link, by: Side) -> None:
        waiting, target = link.waiting[by], link.end_of(by)
        if target is None or link.torn:
            return
        if waiting:
            with contextlib.suppress(BlockingIOError):
                del waiting[: target.send(waiting)]
        if not waiting and by in link.ended and by not in link.shut:
            link.shut.add(by)
            target.shutdown(socket.SHUT_WR)

    def _arm(self, link: _Link) -> None:
        """Wait for readability, and for writability where data is waiting."""
        for side, end in link.ends.items():
            other: Side = "device" if side == "driver" else "driver"
            events = 0
            if side not in link.ended and len(link.waiting[side]) < MAX_HELD:
                events |= selectors.EVENT_READ
            pending = link.waiting[other] or (other in link.ended and other not in link.shut)
            if pending and not self._cut and not link.torn:
                events |= selectors.EVENT_WRITE
            registered = end in self._selector.get_map()
            if events and registered:
                self._selector.modify(end, events)
            elif events:
                self._selector.register(end, events)
            elif registered:
                self._selector.unregister(end)

    def _drop(self, link: _Link) -> None:
        for end in link.ends.values():
            self._links.pop(end, None)
            with contextlib.suppress(KeyError, ValueError):
                self._selector.unregister(end)
            _abort(end) if len(link.shut) < 2 else end.close()
        link.ends.clear()


def _abort(end: socket.socket) -> None:
    with contextlib.suppress(OSError):
        end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESETS)
    end.close()


def _is_v6(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).version == 6
    except ValueError:
        return False
