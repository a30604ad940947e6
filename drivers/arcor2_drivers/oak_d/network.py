"""NetworkSource: the TCP connection to a source that streams images. Independent of depthai."""

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
from arcor2_hw.messages import Message

from .stream import (
    PREFIX,
    BadStream,
    Clock,
    FrameHeader,
    Hello,
    Kind,
    Refusal,
    Status,
    encode,
    read_header,
    read_prefix,
    verify,
)

CLOCK_PERIOD: Final = 0.5
"""Time between requests for the source's clock, s."""
CLOCKS: Final = 20
"""Number of stored answers, of which the closest bound is used. Two quartz clocks drift by at most 1 ms meanwhile."""


class SourceFrame(NamedTuple):
    """A frame, valid until the next one is read. `monotonic` is its time on this computer's clock, s."""

    header: FrameHeader
    monotonic: float
    color: memoryview
    depth: memoryview


class NetworkSource:
    """The connection to a source. One thread calls `next_frame`; other threads may call everything else.

    Args:
        who: Name and address of the source, for errors.
        host: Name or address of the source.
        port: TCP port of the source.
        coding: Coding of colour images: "bgr" or "jpeg".
        on_status: Called with each status that the source sends.
    """

    def __init__(
        self, who: str | Message, host: str, port: int, coding: str, on_status: Callable[[Status], None]
    ) -> None:
        self.who = who
        self._address, self._coding, self._on_status = (host, port), coding, on_status
        self._socket: socket.socket | None = None
        self._sending = threading.Lock()
        self._buffer = bytearray(1 << 20)
        self._offsets: deque[float] = deque(maxlen=CLOCKS)
        """Lower bounds of the difference between this computer's clock and the source's, s."""
        self._clock_asked_at = 0.0
        self._refusal: str = ""
        self._answered = threading.Condition()
        self._statuses = 0
        self.hello: Hello
        self.eeprom: dict[str, Any]

    # -------------------------------------------------------------------------------- connection
    def open(self, deadline: float) -> None:
        """Connect and read the hello until `deadline` (monotonic, s); no frames are requested yet.

        Raises:
            NotConnected: The source cannot be reached.
            DeviceTimeout: It does not answer in time.
            DeviceFault: It does not use this protocol.
        """
        left = max(deadline - time.monotonic(), 0.001)
        try:
            link = socket.create_connection(self._address, left)
        except TimeoutError:
            raise DeviceTimeout(
                "{device} did not accept the connection within {left:.1f} s", device=self.who, left=left
            ) from None
        except OSError as e:
            raise NotConnected("{device} cannot be reached", str(e), device=self.who) from e
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = link
        self._offsets.clear()
        kind, header, payload = self._receive(deadline)
        if kind is not Kind.HELLO:
            raise DeviceFault(
                "{device} sent {name} instead of hello: is it a network source?",
                "",
                "protocol",
                device=self.who,
                name=kind.name.lower(),
            )
        try:
            self.hello = read_header(header, Hello)
            self.eeprom = msgspec.json.decode(payload, type=dict[str, Any])
        except (BadStream, msgspec.DecodeError) as e:
            raise DeviceFault(
                "{device}: the hello is invalid: {reason}", "", "protocol", device=self.who, reason=e
            ) from e

    def start(self, client: str) -> None:
        """Request frames. `client` is the name sent to the source."""
        self._send(Kind.START, {"client": client, "color": self._coding})
        self._ask_clock()

    def close(self) -> None:
        """Close; does nothing when closed. A call that waits for data fails."""
        link, self._socket = self._socket, None
        if link is not None:
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)
            link.close()

    # -------------------------------------------------------------------------------- requests
    def set_exposure(self, exposure: float | None, timeout: float) -> None:
        """Set the exposure time, s, and wait for the confirmation. Raises Refused, DeviceTimeout, ConnectionLost."""
        with self._answered:
            before, self._refusal = self._statuses, ""
            self._send(Kind.CONTROL, {"exposure": exposure})
            answered = self._answered.wait_for(lambda: self._statuses > before or self._refusal, timeout)
            if self._refusal:
                raise Refused("{device} rejected the exposure: {refusal}", device=self.who, refusal=self._refusal)
            if not answered:
                raise DeviceTimeout(
                    "{device} did not confirm the exposure within {timeout:g} s", device=self.who, timeout=timeout
                )

    def _ask_clock(self) -> None:
        self._clock_asked_at = time.monotonic()
        self._send(Kind.CLOCK, {"asked": self._clock_asked_at})

    def _send(self, kind: Kind, header: dict[str, object]) -> None:
        link = self._socket
        if link is None:
            raise NotConnected("{device} is not connected", device=self.who)
        try:
            with self._sending:
                link.sendall(encode(kind, header))
        except OSError as e:
            raise ConnectionLost("{device}: the connection was lost", str(e), device=self.who) from e

    # -------------------------------------------------------------------------------- frames
    def next_frame(self, timeout: float) -> SourceFrame:
        """Return the next frame. Raises DeviceTimeout after `timeout` s, ConnectionLost, DeviceFault."""
        deadline = time.monotonic() + timeout
        while True:
            if time.monotonic() - self._clock_asked_at > CLOCK_PERIOD:
                self._ask_clock()
            kind, header, payload = self._receive(deadline)
            try:
                if kind is not Kind.FRAME:
                    self._handle(kind, header)
                elif self._offsets:  # otherwise the age of the frame is unknown
                    return self._frame(read_header(header, FrameHeader), payload)
            except BadStream as e:
                raise DeviceFault("{device}: {reason}", "", "protocol", device=self.who, reason=e) from e

    def _handle(self, kind: Kind, header: bytes) -> None:
        if kind is Kind.CLOCK:
            clock = read_header(header, Clock)
            if clock.asked > time.monotonic() or not math.isfinite(clock.at):
                raise BadStream("an answer to a clock request that was not sent")
            self._offsets.append(clock.asked - clock.at)  # the source read its clock after the request
        elif kind is Kind.STATUS:
            self._on_status(read_header(header, Status))
            with self._answered:
                self._statuses += 1
                self._answered.notify_all()
        elif kind is Kind.REFUSED:
            with self._answered:
                self._refusal = read_header(header, Refusal).reason[:200]
                self._answered.notify_all()
        else:
            raise BadStream(f"an unexpected message of kind {kind.name.lower()}")

    def _frame(self, header: FrameHeader, payload: memoryview) -> SourceFrame:
        size = self.hello.width * self.hello.height
        if (
            header.color != self._coding
            or header.color_bytes < 1
            or header.color_bytes + header.depth_bytes != len(payload)
        ):
            raise BadStream(f"a frame of {header.color_bytes} + {header.depth_bytes} bytes of {header.color}")
        if header.color == "bgr" and header.color_bytes != 3 * size:
            raise BadStream(f"colour has {header.color_bytes} bytes, not {3 * size}")
        if header.depth_bytes not in (0, 2 * size):
            raise BadStream(f"depth has {header.depth_bytes} bytes, not {2 * size}")
        # An image from before a call must not appear to be from after it. It may appear older, by the round-trip time.
        moment = min(header.stamp + max(self._offsets), time.monotonic())
        if not math.isfinite(moment):
            raise BadStream(f"a frame with the time stamp {header.stamp}")
        return SourceFrame(header, moment, payload[: header.color_bytes], payload[header.color_bytes :])

    def _receive(self, deadline: float) -> tuple[Kind, bytes, memoryview]:
        """Return kind, header and payload of the next message; the payload is valid until the next call."""
        view = memoryview(self._buffer)
        self._fill(view[: PREFIX.size], deadline, between=True)
        try:
            prefix = read_prefix(bytes(view[: PREFIX.size]))
            length = prefix.header + prefix.payload
            if length > len(self._buffer):
                self._buffer = bytearray(length)
                view = memoryview(self._buffer)
            self._fill(view[: prefix.header], deadline)
            header = bytes(view[: prefix.header])
            verify(prefix, header)
        except BadStream as e:
            raise DeviceFault("{device}: {reason}", "", "protocol", device=self.who, reason=e) from e
        payload = view[prefix.header : length]
        self._fill(payload, deadline)
        return prefix.kind, header, payload

    def _fill(self, buffer: memoryview, deadline: float, between: bool = False) -> None:
        """Read until the buffer is full. `between`: no message has started yet."""
        link, count = self._socket, 0
        while count < len(buffer):
            if link is None:
                raise ConnectionLost("{device}: the connection was closed", device=self.who)
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise self._silent(between and count == 0)
            try:
                link.settimeout(left)
                received = link.recv_into(buffer[count:])
            except TimeoutError:
                raise self._silent(between and count == 0) from None
            except OSError as e:
                raise ConnectionLost("{device}: the connection was lost", str(e), device=self.who) from e
            if received == 0:
                refused = Message.of("the source refused: {reason}", reason=self._refusal)
                why = refused if self._refusal else Message.of("the source closed the connection")
                raise ConnectionLost("{device}: the connection was lost: {reason}", device=self.who, reason=why)
            count += received

    def _silent(self, between: bool) -> DeviceError:
        if between:
            return DeviceTimeout("{device} sends nothing", device=self.who)
        return DeviceTimeout("{device} stopped in the middle of a message", device=self.who)
