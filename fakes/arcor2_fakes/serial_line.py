"""The line a host is connected to: a pty that can be pulled out like a USB cable, or a TCP port with the same bytes."""

from __future__ import annotations

import asyncio
import contextlib
import os
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from arcor2_fakes.wire import Connection, Faults, TcpWire

_CHUNK = 4096


class Line(Protocol):
    """What a device is wired to."""

    @property
    def port(self) -> str:
        """What a host opens: a path, or a `socket://` URL."""
        ...

    @property
    def plugged(self) -> bool:
        """Whether a host could open it."""
        ...

    def send(self, frame: bytes) -> None:
        """Put a frame on the line; it is lost if nobody listens."""
        ...

    async def plug(self) -> None:
        """Connect the device; does nothing if it is connected."""
        ...

    async def unplug(self) -> None:
        """Pull the cable; does nothing if it is pulled."""
        ...

    async def fault(self, kind: str, seconds: float = 1.0) -> None:
        """Apply one of the shared faults."""
        ...


class PtyLine:
    """A pseudo terminal, as a USB virtual serial port.

    Args:
        received: called with bytes from the host.
        link: where a symbolic link to the terminal is kept, since its own path changes with each `plug`.
    """

    def __init__(self, received: Callable[[bytes], None], link: Path | None = None) -> None:
        self._received = received
        self._link = link
        self._ends: tuple[int, int] | None = None  # ours, and the host's, kept open so that a host may come and go
        self._path = ""
        self._faults = Faults()
        self._loop = asyncio.get_running_loop()

    @property
    def port(self) -> str:
        """The link if there is one, else the terminal's path."""
        return self._path if self._link is None else str(self._link)

    @property
    def plugged(self) -> bool:
        """Whether the terminal is there."""
        return self._ends is not None

    def send(self, frame: bytes) -> None:
        """Put a frame on the line."""
        data = self._faults.outgoing(frame)
        if data and self._faults.delay:
            self._loop.call_later(self._faults.delay, self._write, data)
        elif data:
            self._write(data)

    def _write(self, data: bytes) -> None:
        if self._ends is not None:
            # A full buffer means that nobody reads; what a serial line carries then is lost.
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
        """Make a new terminal and let the link point to it. Raises `OSError` if there can be no such link."""
        if self._ends is not None:
            return
        ours, hosts = os.openpty()
        self._ends = ours, hosts
        tty.setraw(hosts)
        os.set_blocking(ours, False)
        self._path = os.ttyname(hosts)
        if self._link is not None:
            try:
                _point(self._link, self._path)
            except OSError:
                self._close_ends()
                raise
        self._loop.add_reader(ours, self._readable)

    async def unplug(self) -> None:
        """Take the terminal away: the host's reads and writes fail from now on."""
        if self._ends is not None:
            self._loop.remove_reader(self._ends[0])
            self._close_ends()
            if self._link is not None:
                self._link.unlink(missing_ok=True)

    def _close_ends(self) -> None:
        assert self._ends is not None
        for end in self._ends:
            os.close(end)
        self._ends = None

    async def fault(self, kind: str, seconds: float = 1.0) -> None:
        """Apply one of the shared faults; a reset is pulled and plugged again, a port that refuses is gone."""
        self._faults.set(kind, seconds)
        if kind in ("reset", "refuse"):
            await self.unplug()
        if kind in ("reset", "heal"):
            await self.plug()


class TcpLine:
    """A TCP port, as a serial device server. One host at a time: who comes last has the line."""

    def __init__(self, received: Callable[[bytes], None], host: str, port: int) -> None:
        self._received = received
        self._wire = TcpWire("serial", host, port, self._opened)
        self._plugged = False

    @property
    def port(self) -> str:
        """A URL that pyserial's `serial_for_url` takes."""
        return f"socket://{self._wire.address}"

    @property
    def plugged(self) -> bool:
        """Whether the port is open."""
        return self._plugged

    def _opened(self, connection: Connection) -> None:
        for other in self._wire.connections - {connection}:
            other.close()
        connection.received = self._received

    def send(self, frame: bytes) -> None:
        """Put a frame on the line."""
        for connection in tuple(self._wire.connections):
            connection.send(frame)

    async def plug(self) -> None:
        """Listen. Raises `OSError` when the port is taken."""
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


def _point(link: Path, target: str) -> None:
    """Let the link point to the target in one step, so that a host never finds half a change."""
    if link.exists() and not link.is_symlink():
        raise FileExistsError(f"{link} exists and is no symbolic link")
    new = link.with_name(f"{link.name}.{os.getpid()}")
    new.symlink_to(target)
    new.replace(link)
