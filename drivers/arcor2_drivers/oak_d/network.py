"""A network source: one TCP connection, read by the thread that asks for the next frame. Knows nothing of depthai."""

import contextlib
import math
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import msgspec

from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, NotConnected, Refused

from .stream import (
    FIXED,
    BadStream,
    Clock,
    FrameHeader,
    Front,
    Hello,
    Kind,
    Refusal,
    Status,
    check,
    front,
    message,
    read,
)

SEND_TIMEOUT: Final = 0.5
CLOCK_PERIOD: Final = 0.5
"""Time between questions for the source's clock, s."""
CLOCKS: Final = 20
"""Answers of which the promptest counts: 10 s, in which two quartz clocks drift apart by a millisecond at most."""


class SourceFrame(NamedTuple):
    """A frame as it came; valid until the next is asked for. `monotonic` is on this computer's clock."""

    header: FrameHeader
    monotonic: float
    color: memoryview
    depth: memoryview


class NetworkSource:
    """The connection to one source. `next_frame` is called by one thread, all else by others."""

    def __init__(self, who: str, host: str, port: int, coding: str, status: Callable[[Status], None]) -> None:
        self.who = who
        self._where, self._coding, self._tell_status = (host, port), coding, status
        self._socket: socket.socket | None = None
        self._sending = threading.Lock()
        self._buffer = bytearray(1 << 20)
        self._offsets: deque[tuple[float, float]] = deque(maxlen=CLOCKS)
        self._asked_clock = 0.0
        self._refusal: str = ""
        self._status = threading.Condition()
        self._statuses = 0
        self.hello: Hello
        self.eeprom: dict[str, Any]

    # -------------------------------------------------------------------------------- life
    def open(self, deadline: float) -> None:
        """Connect and take the hello; nothing is asked for yet. Raises NotConnected, DeviceTimeout, DeviceFault."""
        left = max(deadline - time.monotonic(), 0.001)
        try:
            link = socket.create_connection(self._where, left)
        except TimeoutError:
            raise DeviceTimeout(
                "{device} did not take the connection within {left:.1f} s", device=self.who, left=left
            ) from None
        except OSError as e:
            raise NotConnected("{device} cannot be reached", str(e), device=self.who) from e
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = link
        self._offsets.clear()
        head, header, payload = self._message(deadline)
        if head.kind is not Kind.HELLO:
            raise DeviceFault(
                "{device} does not say hello but {name}", "", "protocol", device=self.who, name=head.kind.name.lower()
            )
        try:
            self.hello = read(header, Hello)
            self.eeprom = msgspec.json.decode(payload, type=dict[str, Any])
        except (BadStream, msgspec.DecodeError) as e:
            raise DeviceFault(
                "{device}: the hello is not readable: {reason}", "", "protocol", device=self.who, reason=e
            ) from e

    def start(self, client: str) -> None:
        """Ask for frames."""
        self._say(Kind.START, {"client": client, "color": self._coding})
        self._ask_clock()

    def close(self) -> None:
        """Close; does nothing when closed. Whoever waits in it wakes."""
        link, self._socket = self._socket, None
        if link is not None:
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)
            link.close()

    # -------------------------------------------------------------------------------- asking
    def set_exposure(self, exposure: float | None, timeout: float) -> None:
        """Set the exposure; return when the source says so. Raises Refused, DeviceTimeout, ConnectionLost."""
        with self._status:
            before, self._refusal = self._statuses, ""
            self._say(Kind.CONTROL, {"exposure": exposure})
            answered = self._status.wait_for(lambda: self._statuses > before or self._refusal, timeout)
            if self._refusal:
                raise Refused("{device} refuses: {refusal}", device=self.who, refusal=self._refusal)
            if not answered:
                raise DeviceTimeout(
                    "{device} did not answer to set_exposure within {timeout:g} s", device=self.who, timeout=timeout
                )

    def _ask_clock(self) -> None:
        self._asked_clock = time.monotonic()
        self._say(Kind.CLOCK, {"asked": self._asked_clock})

    def _say(self, kind: Kind, header: dict[str, object]) -> None:
        link = self._socket
        if link is None:
            raise NotConnected("{device} is not connected", device=self.who)
        try:
            with self._sending:
                link.sendall(message(kind, header))
        except OSError as e:
            raise ConnectionLost("{device}: the connection was lost", str(e), device=self.who) from e

    # -------------------------------------------------------------------------------- reading
    def next_frame(self, timeout: float) -> SourceFrame:
        """Wait for a frame. Raises DeviceTimeout after `timeout` s, ConnectionLost, DeviceFault."""
        deadline = time.monotonic() + timeout
        while True:
            if time.monotonic() - self._asked_clock > CLOCK_PERIOD:
                self._ask_clock()
            head, header, payload = self._message(deadline)
            try:
                if head.kind is Kind.FRAME:
                    told = read(header, FrameHeader)
                    if self._offsets:
                        return self._frame(told, payload)
                    continue  # before the first answer of the clock nobody knows how old it is
                self._take(head.kind, header)
            except BadStream as e:
                raise DeviceFault("{device}: {reason}", "", "protocol", device=self.who, reason=e) from e

    def _take(self, kind: Kind, header: bytes) -> None:
        if kind is Kind.CLOCK:
            clock, now = read(header, Clock), time.monotonic()
            if clock.asked > now or not math.isfinite(clock.at):
                raise BadStream("the clock was never asked that")
            self._offsets.append((now - clock.asked, (now + clock.asked) / 2.0 - clock.at))
        elif kind is Kind.STATUS:
            status = read(header, Status)
            self._tell_status(status)
            with self._status:
                self._statuses += 1
                self._status.notify_all()
        elif kind is Kind.REFUSED:
            with self._status:
                self._refusal = read(header, Refusal).reason[:200]
                self._status.notify_all()
        else:
            raise BadStream(f"a {kind.name.lower()} was not to be expected")

    def _frame(self, told: FrameHeader, payload: memoryview) -> SourceFrame:
        size = self.hello.width * self.hello.height
        if told.color != self._coding or told.color_bytes < 1 or told.color_bytes + told.depth_bytes != len(payload):
            raise BadStream(f"a frame of {told.color_bytes} + {told.depth_bytes} bytes of {told.color} came")
        if told.color == "bgr" and told.color_bytes != 3 * size:
            raise BadStream(f"colour has {told.color_bytes} bytes, not {3 * size}")
        if told.depth_bytes not in (0, 2 * size):
            raise BadStream(f"depth has {told.depth_bytes} bytes, not {2 * size}")
        _, offset = min(self._offsets)
        # An estimate that is off by half a way of the answer must not make a picture come from the future.
        moment = min(told.stamp + offset, time.monotonic())
        if not math.isfinite(moment):
            raise BadStream(f"a frame's stamp is {told.stamp}")
        return SourceFrame(told, moment, payload[: told.color_bytes], payload[told.color_bytes :])

    def _message(self, deadline: float) -> tuple[Front, bytes, memoryview]:
        view = memoryview(self._buffer)
        self._read(view[: FIXED.size], deadline, idle=True)
        try:
            head = front(bytes(view[: FIXED.size]))
            length = head.header + head.payload
            if length > len(self._buffer):
                self._buffer = bytearray(length)
                view = memoryview(self._buffer)
            self._read(view[: head.header], deadline)
            header = bytes(view[: head.header])
            check(head, header)
        except BadStream as e:
            raise DeviceFault("{device}: {reason}", "", "protocol", device=self.who, reason=e) from e
        payload = view[head.header : length]
        self._read(payload, deadline)
        return head, header, payload

    def _read(self, into: memoryview, deadline: float, idle: bool = False) -> None:
        link, came = self._socket, 0
        while came < len(into):
            if link is None:
                raise ConnectionLost("{device}: the connection was closed", device=self.who)
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise self._silent(idle and came == 0)
            try:
                link.settimeout(left)
                got = link.recv_into(into[came:])
            except TimeoutError:
                raise self._silent(idle and came == 0) from None
            except OSError as e:
                raise ConnectionLost("{device}: the connection was lost", str(e), device=self.who) from e
            if got == 0:
                why = f"it said: {self._refusal}" if self._refusal else "the source closed it"
                raise ConnectionLost("{device}: the connection was lost: {reason}", device=self.who, reason=why)
            came += got

    def _silent(self, between: bool) -> DeviceError:
        what = "sends nothing" if between else "stopped in the middle of a message"
        return DeviceTimeout("{device} {what}", device=self.who, what=what)
