"""LineDevice: a device that answers requests on a serial port or a TCP socket. A mixin of object types."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from typing import Final, TypeVar

from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout, NotConnected
from arcor2_hw.messages import device_at
from arcor2_hw.objects.connected import Connected
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.line import READ_PERIOD, Line
from arcor2_hw.objects.state_observer import CLOSED_BY_US

T = TypeVar("T")

CLOSING_REQUEST_TIME: Final = 0.3
"""Time that a request in progress has before the line is closed, s."""


class LineDevice(Connected):
    """A device on a `Line`. Call `use_line` in `__init__`.

    A driver overrides `greet`, which is called after the line was opened, and `poll`, which is called every
    `poll_period` s while the line is free. It may override `on_unasked` for unsolicited data and `overdue` for missing
    answers. These methods use `ask` and raise DeviceError. A missing answer ends the connection, which is opened again.
    """

    poll_period: float = 1.0
    """Time between two calls of `poll`, s."""
    line: Line

    def use_line(
        self,
        port: str,
        baud_rate: int,
        answer_timeout: float,
        *,
        parity: str = "N",
        stopbits: int = 1,
        data_bits: int = 8,
    ) -> None:
        """Create the line without opening it; see `Line` for the arguments."""
        who = device_at(self.name, port)
        self.line = Line(who, port, baud_rate, answer_timeout, parity=parity, stopbits=stopbits, data_bits=data_bits)
        self.keep_connection(self.line.who)
        self._ending = False

    # -------------------------------------------------------------------------------- hooks
    def greet(self, deadline: float) -> None:
        """Check that the device answers before `deadline` (monotonic, s). Raises DeviceError."""

    def poll(self) -> None:
        """Read the state of the device. Raises DeviceError."""

    def on_unasked(self, data: bytes) -> None:
        """Process unsolicited bytes."""

    def overdue(self, error: DeviceTimeout) -> DeviceError:
        """Return the error to raise for a missing answer."""
        return error

    # -------------------------------------------------------------------------------- requests
    @contextlib.contextmanager
    def held(self, patience: float = 0.0) -> Iterator[None]:
        """Lock the line.

        Raises:
            NotConnected: The device is not connected.
            DeviceError: The connection was lost by this error.
            Refused: The line stays locked for `patience` s, by default 4 answer timeouts.
        """
        self.check()
        with self.line.held(patience):
            self.check()
            yield

    def check(self) -> None:
        """Check that the device is observed. Raises NotConnected, or the error by which the connection was lost."""
        try:
            self.observing.check()
        except ConnectionLost as error:
            raise self.line.loss_again() or error from None
        except NotConnected as error:
            raise NotConnected("{device} is not connected", error.detail, device=self.who) from None
        if (loss := self.line.loss_again()) is not None:
            raise loss

    def ask(self, question: bytes, answer: Callable[[bytes], T | None], name: str, timeout: float = 0.0) -> T:
        """Send a request and return the decoded answer; see `Line.ask`."""
        with self.line.held():
            if data := self.line.waiting():
                self.on_unasked(data)
            broken = self.line.loss
            try:
                return self.line.ask(question, answer, name, timeout)
            except DeviceTimeout as late:
                error = self.overdue(late)
                self.line.loss = broken or error
                raise error from None

    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Open the line and greet the device within `timeout` s. Raises NotConnected, DeviceTimeout, DeviceFault."""
        self._ending = False
        super().connect(timeout)

    def disconnect(self) -> None:
        """Stop observing and close the line. A request in progress may end first."""
        with contextlib.suppress(DeviceError), self.line.held(CLOSING_REQUEST_TIME):
            pass
        self._ending = True
        self.line.close()
        super().disconnect()

    # -------------------------------------------------------------------------------- on the observing thread
    def open_link(self, timeout: float) -> None:
        """Open the line and greet the device."""
        deadline = time.monotonic() + timeout
        before = self.line.loss
        try:
            self.line.open(timeout)
            if self._ending:
                raise NotConnected("{device} is being disconnected", device=self.who)
            with self.line.held():
                self.greet(deadline)
        except DeviceError:
            self.line.loss = before or self.line.loss
            raise

    def close_link(self) -> None:
        """Close the line."""
        self.line.close()

    def watch(self, stopping: threading.Event) -> None:
        """Poll the device and process unsolicited data."""
        try:
            self._poll_until(stopping)
        except DeviceError:
            if not self._ending:
                raise
            stopping.wait(CLOSED_BY_US)  # not a loss: we closed the line

    def _poll_until(self, stopping: threading.Event) -> None:
        polled = time.monotonic()
        while not stopping.wait(READ_PERIOD):
            if self.line.loss is not None:
                raise self.line.loss
            with self.line.held_if_free() as free:
                if free and (data := self.line.waiting()):
                    self.on_unasked(data)
                if free and time.monotonic() - polled >= self.poll_period:
                    self.poll()
                    polled = time.monotonic()

    def on_lost(self, error: DeviceError) -> None:
        """Break the line with the error by which the connection was lost."""
        self.line.broken(error)


# Names before version 0.2.
LAST_REQUEST_TIME = CLOSING_REQUEST_TIME
