"""Serial lines of devices: a pty that can be unplugged like a USB cable, or a TCP port that carries the same bytes."""

from __future__ import annotations

import asyncio
import contextlib
import os
import tempfile
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from arcor2_fakes.control import parse_address
from arcor2_fakes.wire import Connection, Faults, TcpWire

_CHUNK = 4096


class Line(Protocol):
    """Serial line of a device."""

    @property
    def port(self) -> str:
        """Return the path or `socket://` URL that a host opens."""
        ...

    @property
    def plugged(self) -> bool:
        """Return whether a host can open the line."""
        ...

    def send(self, frame: bytes) -> None:
        """Send a frame; it is lost without a host."""
        ...

    async def plug(self) -> None:
        """Plug the cable in, unless it is."""
        ...

    async def unplug(self) -> None:
        """Unplug the cable, unless it is."""
        ...

    async def fault(self, kind: str, seconds: float = 1.0) -> None:
        """Apply one of the shared faults."""
        ...


class PtyLine:
    """A pseudo terminal that acts as a USB serial port.

    Args:
        received: Called with bytes from the host.
        link: Symbolic link to the terminal. Without it, the line makes one in a temporary directory.

    A host never gets the path of the terminal itself. This path changes with each `plug`, and the system soon gives it
    to somebody else's terminal, which a host that reconnects would then open and lock.
    """

    def __init__(self, received: Callable[[bytes], None], link: Path | None = None) -> None:
        self._received = received
        if link is None:
            self._folder = tempfile.TemporaryDirectory(prefix="arcor2-fake-")
            link = Path(self._folder.name) / "tty"
        self._link = link
        self._ends: tuple[int, int] | None = (
            None  # ours and the host's; the latter stays open, so that hosts can open and close the terminal
        )
        self._faults = Faults()
        self._loop = asyncio.get_running_loop()

    @property
    def port(self) -> str:
        """Return the link, which stays the same when the line is unplugged and plugged in."""
        return str(self._link)

    @property
    def plugged(self) -> bool:
        """Return whether the terminal exists."""
        return self._ends is not None

    def send(self, frame: bytes) -> None:
        """Send a frame."""
        data = self._faults.outgoing(frame)
        if data and self._faults.delay:
            self._loop.call_later(self._faults.delay, self._write, data)
        elif data:
            self._write(data)

    def _write(self, data: bytes) -> None:
        if self._ends is not None:
            # A full buffer means that no host reads. A real line loses the bytes, too.
            with contextlib.suppress(BlockingIOError):
                os.write(self._ends[0], data)

    def _readable(self) -> None:
        assert self._ends is not None
        try:
            data = os.read(self._ends[0], _CHUNK)
        except BlockingIOError:
            return
        if not self._faults.silent:
            self._received(data)

    async def plug(self) -> None:
        """Create a terminal and the link to it. Raise `OSError` if the link cannot be created."""
        if self._ends is not None:
            return
        ours, hosts = os.openpty()
        self._ends = ours, hosts
        tty.setraw(hosts)
        os.set_blocking(ours, False)
        try:
            _point(self._link, os.ttyname(hosts))
        except OSError:
            self._close_ends()
            raise
        self._loop.add_reader(ours, self._readable)

    async def unplug(self) -> None:
        """Close the terminal, so that reads and writes of the host fail."""
        if self._ends is not None:
            self._loop.remove_reader(self._ends[0])
            self._close_ends()
            self._link.unlink(missing_ok=True)

    def _close_ends(self) -> None:
        assert self._ends is not None
        for end in self._ends:
            os.close(end)
        self._ends = None

    async def fault(self, kind: str, seconds: float = 1.0) -> None:
        """Apply one of the shared faults. A reset unplugs and plugs the cable, refuse unplugs it."""
        self._faults.set(kind, seconds)
        if kind in ("reset", "refuse"):
            await self.unplug()
        if kind in ("reset", "heal"):
            await self.plug()


class TcpLine:
    """A TCP port, as of a serial device server. A new host replaces the previous one."""

    def __init__(self, received: Callable[[bytes], None], host: str, port: int) -> None:
        self._received = received
        self._wire = TcpWire("serial", host, port, self._opened)
        self._plugged = False

    @property
    def port(self) -> str:
        """Return a URL for `serial_for_url` of pyserial."""
        return f"socket://{self._wire.address}"

    @property
    def plugged(self) -> bool:
        """Return whether the port is open."""
        return self._plugged

    def _opened(self, connection: Connection) -> None:
        for other in self._wire.connections - {connection}:
            other.close()
        connection.received = self._received

    def send(self, frame: bytes) -> None:
        """Send a frame."""
        for connection in tuple(self._wire.connections):
            connection.send(frame)

    async def plug(self) -> None:
        """Listen. Raise `OSError` if the port is in use."""
        await self._wire.listen()
        self._plugged = True

    async def unplug(self) -> None:
        """Close the port and reset the connection."""
        self._wire.refuse()
        self._wire.reset()
        self._plugged = False

    async def fault(self, kind: str, seconds: float = 1.0) -> None:
        """Apply one of the shared faults."""
        await self._wire.fault(kind, seconds)
        self._plugged = self._plugged if kind not in ("refuse", "heal") else kind == "heal"


def line_at(feed: Callable[[bytes], None], link: Path | None, tcp: str | None) -> Line:
    """Return a line on TCP at HOST:PORT, or on a pty with a symbolic link. Raise `ValueError` for another address."""
    return PtyLine(feed, link) if tcp is None else TcpLine(feed, *parse_address(tcp))


def _point(link: Path, target: str) -> None:
    """Replace the link atomically, so that a host always finds a valid one."""
    if link.exists() and not link.is_symlink():
        raise FileExistsError(f"{link} exists and is not a symbolic link")
    new = link.with_name(f"{link.name}.{os.getpid()}")
    new.symlink_to(target)
    new.replace(link)
