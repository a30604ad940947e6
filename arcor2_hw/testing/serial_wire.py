"""The wire of a device on a serial port: a pseudo terminal in place of the port, which can be unplugged."""

import contextlib
import os
import select
import tempfile
import termios
import threading
import tty
from pathlib import Path
from typing import Final

from arcor2_hw.testing.wire import Wire

_CHUNK: Final = 4096
_CHECK_PERIOD: Final = 0.1
"""Period of the check whether an unplugged port is back, s."""


class SerialWire(Wire):
    """A wire for the port at `path`. It adopts the baud rate, parity and stop bits that the driver sets."""

    def __init__(self, path: str) -> None:
        super().__init__()
        self._path = path
        self._device = -1
        self._ends: tuple[int, int] | None = (
            None  # our end, and that of the driver, which stays open so that a driver can reopen it
        )
        self._mode: list[object] = []
        self._thread: threading.Thread | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._count = 0

    @property
    def address(self) -> str:
        """Return the path that the driver opens; it stays the same when the port is unplugged and plugged in."""
        return str(self._link)

    @property
    def _link(self) -> Path:
        assert self._folder is not None, "the wire was not started"
        return Path(self._folder.name) / "tty"

    # -------------------------------------------------------------------------------- life
    def start(self) -> None:
        """Open the device's port and the terminal for the driver."""
        self._device = self._open_device()
        self._folder = tempfile.TemporaryDirectory(prefix="arcor2-hw-wire-")
        self._alarm_in, self._alarm = os.pipe()
        self._ending = False
        self._plug()
        self._thread = threading.Thread(target=self._run, name=f"wire to {self._path}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close the port and the terminal."""
        if self._folder is None:
            return
        self._ending = True
        os.write(self._alarm, b"!")
        if self._thread is not None:
            self._thread.join()
        with self._lock:
            self._unplug()
            for descriptor in (self._device, self._alarm, self._alarm_in):
                if descriptor >= 0:
                    os.close(descriptor)
            self._device = -1
        self._folder.cleanup()
        self._folder = None

    def _open_device(self) -> int:
        descriptor = os.open(self._path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(descriptor)
        except termios.error:
            os.close(descriptor)
            raise OSError(f"{self._path} is not a serial port") from None
        return descriptor

    def _plug(self) -> None:
        ours, drivers = os.openpty()
        tty.setraw(drivers)
        os.set_blocking(ours, False)
        self._ends = ours, drivers
        self._mode = []
        self._count += 1
        new = self._link.with_name("new")
        new.symlink_to(os.ttyname(drivers))
        new.replace(self._link)

    def _unplug(self) -> None:
        if self._ends is not None:
            self._link.unlink(missing_ok=True)
            for end in self._ends:
                os.close(end)
            self._ends = None

    # -------------------------------------------------------------------------------- faults
    def reset(self) -> None:
        """Unplug the port and plug it in again."""
        with self._lock:
            self._unplug()
            self._plug()
        os.write(self._alarm, b"!")

    def _healed(self) -> None:
        """Discard everything: data on a cut line is lost."""

    # -------------------------------------------------------------------------------- forwarding
    def _run(self) -> None:
        while not self._ending:
            with self._lock:
                ends, device = self._ends, self._device
            watched = [each for each in (self._alarm_in, device, ends[0] if ends else -1) if each >= 0]
            try:
                ready, _, _ = select.select(watched, [], [], _CHECK_PERIOD if device < 0 else None)
            except OSError:  # another thread has unplugged it
                continue
            with self._lock:
                if self._alarm_in in ready:
                    os.read(self._alarm_in, 64)
                if self._ends is not None and self._ends is ends and ends[0] in ready:
                    self._from_driver(ends[0])
                if device < 0 and not self._ending:
                    self._check_device()
                elif device in ready:
                    self._from_device(device)

    def _from_driver(self, end: int) -> None:
        try:
            data = os.read(end, _CHUNK)
        except OSError:
            return
        self._keep("driver", self._count, data)
        if self._cut or self._device < 0:
            return
        self._copy_line_settings(end)
        self._write(self._device, data)

    def _from_device(self, device: int) -> None:
        try:
            data = os.read(device, _CHUNK)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:  # the port was unplugged, so the port of the driver is unplugged too
            os.close(device)
            self._device = -1
            self._unplug()
            return
        self._keep("device", self._count, data)
        if self._cut or self._ends is None:
            return
        data, _ = self._torn(data)
        self._write(self._ends[0], data)

    def _check_device(self) -> None:
        with contextlib.suppress(OSError):
            self._device = self._open_device()
            self._plug()

    def _copy_line_settings(self, end: int) -> None:
        with contextlib.suppress(termios.error):
            wanted = termios.tcgetattr(end)
            mode = [wanted[2], wanted[4], wanted[5]]
            if mode != self._mode:
                now = termios.tcgetattr(self._device)
                now[2], now[4], now[5] = wanted[2], wanted[4], wanted[5]
                termios.tcsetattr(self._device, termios.TCSADRAIN, now)
                self._mode = mode

    @staticmethod
    def _write(end: int, data: bytes) -> None:
        """Write the data that fits into the buffer. Unread data of a serial line is lost."""
        while data:
            try:
                data = data[os.write(end, data) :]
            except OSError:
                return
