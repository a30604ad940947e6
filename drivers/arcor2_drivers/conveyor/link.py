"""CanLink: the CAN bus to a drive, with one SDO request at a time. Late answers are ignored."""

import contextlib
import logging
import queue
import socket
import struct
import threading
import time
from collections.abc import Callable
from typing import Any, Final

import can
import canopen
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, NotConnected
from arcor2_hw.keep_alive import LONGEST_STEP, RunningTime, acquire_within
from arcor2_hw.messages import Message

from .cia402 import Entry
from .settings import CanInterface, ConveyorSettings
from .slcan import SlcanBus
from .socketcand import SocketcandBus

RECEIVE_TIMEOUT: Final = 0.05
"""Longest time the receiver waits for a frame before it checks whether it should end, s."""
WRITE_TIMEOUT: Final = 5.0
"""Time the adapter has to accept a frame, s. It is that long because pyserial also raises if this process stalls while
sending. An adapter that accepts nothing is noticed earlier, by the missing answer."""
NMT_START: Final = 1
HEARTBEAT: Final = 0x700
EMCY: Final = 0x80
OPERATIONAL: Final = b"\x05"

# canopen logs every failure as an error; here it is raised, and a drive that is off would fill the log.
logging.getLogger("canopen").setLevel(logging.CRITICAL)

FrameHandler = Callable[[int, bytes], None]


class _Network(canopen.Network):
    """The network of canopen without its receiving thread, and with a time limit for sending."""

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        bus = self.bus
        if bus is None:
            raise can.CanOperationError("the bus is closed")
        message = can.Message(arbitration_id=can_id, data=data, is_extended_id=False, is_remote_frame=remote)
        with self.send_lock:
            bus.send(message, timeout=WRITE_TIMEOUT)


class _Responses(queue.Queue[bytes]):
    """A queue of answers whose time limit does not count stalls of this process."""

    def get(self, block: bool = True, timeout: float | None = None) -> bytes:
        clock = RunningTime()
        while True:
            try:
                return super().get(block, timeout and min(timeout, LONGEST_STEP / 2.0))
            except queue.Empty:
                if not block or timeout is None or clock() >= timeout:
                    raise


class _Sdo(SdoClient):
    """An SDO client that accepts only the answer to its request, by index and subindex."""

    _expected = b""

    def __init__(self, *arguments: Any) -> None:
        self._responses = _Responses()
        super().__init__(*arguments)  # type: ignore[no-untyped-call]

    @property
    def responses(self) -> _Responses:
        """The received answers. canopen replaces the queue when it is not empty."""
        return self._responses

    @responses.setter
    def responses(self, _: object) -> None:
        self._responses = _Responses()

    def send_request(self, request: Any) -> None:
        self._expected = bytes(request[1:4])
        super().send_request(request)  # type: ignore[no-untyped-call]

    def on_response(self, can_id: int, data: Any, timestamp: float) -> None:
        if len(data) == 8 and bytes(data[1:4]) == self._expected:
            super().on_response(can_id, data, timestamp)  # type: ignore[no-untyped-call]


class CanLink:
    """The connection to a drive. Several threads may send requests, which are executed one after the other.

    When an answer does not come in time, the link is broken until `open`: a late answer must not be taken for the
    answer to another request for the same index. An SDO server answers in order, so the requests after `open` drain
    late answers.
    """

    def __init__(self, name: str, settings: ConveyorSettings, hear: FrameHandler) -> None:
        self.who: str | Message = Message.of(
            "{device} at {channel} node {node}", device=name, channel=settings.channel, node=settings.node_id
        )
        self._settings, self._hear = settings, hear
        self._one_request = threading.Lock()
        self._network: _Network | None = None
        self._bus: can.BusABC | None = None
        self._sdo: _Sdo | None = None
        self._receiver: threading.Thread | None = None
        self._closing = threading.Event()
        self.loss: DeviceError | None = None

    # -------------------------------------------------------------------------------- life
    def open(self, timeout: float) -> None:
        """Open the bus within `timeout` s; nothing is sent to the drive. Raises NotConnected, DeviceTimeout."""
        self.close()
        settings = self._settings
        try:
            bus = self._connected(timeout)
        except (TimeoutError, can.CanTimeoutError) as error:
            raise DeviceTimeout(
                "{device}: the CAN adapter cannot be reached within {timeout:.1f} s",
                str(error),
                device=self.who,
                timeout=timeout,
            ) from error
        except (can.CanError, OSError, ValueError) as error:
            raise NotConnected("{device}: the CAN adapter cannot be reached", str(error), device=self.who) from error
        self._bus, self.loss = bus, None
        network = _Network(bus)
        self._network = network
        node, od = settings.node_id, canopen.ObjectDictionary()  # type: ignore[no-untyped-call]
        sdo = _Sdo(0x600 + node, 0x580 + node, od)
        sdo.network, sdo.RESPONSE_TIMEOUT = network, settings.sdo_timeout
        network.subscribe(0x580 + node, sdo.on_response)
        self._sdo, self._closing = sdo, threading.Event()
        self._receiver = threading.Thread(
            target=self._receive, args=(bus, network, self._closing), name=f"CAN to {self.who}", daemon=True
        )
        self._receiver.start()

    def _connected(self, timeout: float) -> can.BusABC:
        settings = self._settings
        if settings.channel.startswith("socket://"):
            host, port, name = settings.server
            if settings.interface is CanInterface.SOCKETCAND:
                return SocketcandBus(name, host, port, timeout)
            # Check that the port is open, because pyserial waits five seconds for it, independent of its timeout.
            socket.create_connection((host, port), timeout).close()
        if settings.interface is CanInterface.SLCAN:
            return SlcanBus(settings.channel, bitrate=settings.bitrate, sleep_after_open=0.0, timeout=RECEIVE_TIMEOUT)
        return can.Bus(channel=settings.channel, interface=settings.interface.value)

    def close(self) -> None:
        """Close; does nothing when closed."""
        self._closing.set()
        self.loss = self.loss or NotConnected("{device} is not connected", device=self.who)
        receiver, self._receiver = self._receiver, None
        bus, self._bus, network = self._bus, None, self._network
        port = getattr(bus, "serialPortOrig", None)
        raw = getattr(port, "_socket", None)
        if isinstance(bus, SocketcandBus):
            with contextlib.suppress(OSError):  # the other end has closed it
                bus.wake()
        if isinstance(bus, SlcanBus) and raw is not None:
            with contextlib.suppress(can.CanError, OSError):
                bus.close()  # the adapter's channel
            with contextlib.suppress(OSError):
                raw.shutdown(socket.SHUT_RDWR)  # wakes the receiver
        if receiver is not None and receiver is not threading.current_thread():
            receiver.join(4.0 * RECEIVE_TIMEOUT)
        if network is not None:
            network.bus = None
        if bus is None:
            return
        if raw is not None and port is not None:
            # Closed here, because pyserial sleeps 0.3 s and does not close a socket that was reset by its peer.
            raw.close()
            port.is_open = False
            can.BusABC.shutdown(bus)
        else:
            with contextlib.suppress(can.CanError, OSError):
                bus.shutdown()

    def _receive(self, bus: can.BusABC, network: _Network, closing: threading.Event) -> None:
        while not closing.is_set():
            try:
                message = bus.recv(RECEIVE_TIMEOUT)
            except (ValueError, IndexError):  # the adapter sent invalid bytes
                flush = getattr(bus, "flush", None)
                if flush is not None:
                    with contextlib.suppress(can.CanError):
                        flush()
                continue
            except (can.CanError, OSError, TypeError) as error:
                if not closing.is_set():
                    self._lose(
                        ConnectionLost("{device}: the connection to the CAN bus was lost", str(error), device=self.who)
                    )
                return
            if message is None or message.is_error_frame or message.is_remote_frame or message.is_extended_id:
                continue
            network.notify(message.arbitration_id, message.data, message.timestamp)
            self._hear(message.arbitration_id, bytes(message.data))

    def _lose(self, error: DeviceError) -> DeviceError:
        self.loss = self.loss or error
        return self.loss

    def lose(self, error: DeviceError) -> None:
        """Mark the link as broken until it is opened again. `error` is the reason."""
        self._lose(error)

    def check(self) -> None:
        """Raise the error that broke the link, if any."""
        if self.loss is not None:
            raise _again(self.loss)

    # -------------------------------------------------------------------------------- requests
    def read(self, entry: Entry) -> int:
        """Read a value. Raises DeviceTimeout, ConnectionLost, DeviceFault when the drive refuses."""
        what = f"reading {entry.title} ({entry.at:04X}h:{entry.subindex:02X})"
        data = self._request(lambda sdo: sdo.upload(entry.at, entry.subindex), what)
        size = struct.calcsize(entry.form)
        if len(data) < size:
            raise DeviceFault(
                "{device}: {what} gave {count} bytes instead of {size}",
                device=self.who,
                what=what,
                count=len(data),
                size=size,
            )
        return int(struct.unpack(entry.form, data[:size])[0])

    def read_first(self, entry: Entry, timeout: float, enough: Callable[[], bool]) -> int:
        """Read a constant value repeatedly until the drive answers, because it may be booting.

        Raises:
            DeviceTimeout: No answer came within `timeout` s, or before `enough` returned true.
        """
        deadline = time.monotonic() + timeout
        while True:
            try:
                return self.read(entry)
            except DeviceTimeout as error:
                if enough() or time.monotonic() + self._settings.sdo_timeout > deadline:
                    raise DeviceTimeout(
                        "{device} does not answer within {timeout:.1f} s", str(error), device=self.who, timeout=timeout
                    ) from error
                self.loss = None

    def write(self, entry: Entry, value: int) -> None:
        """Write a value; it is never repeated. Raises DeviceTimeout, ConnectionLost, DeviceFault."""
        what = f"writing {value} to {entry.title} ({entry.at:04X}h:{entry.subindex:02X})"
        data = struct.pack(entry.form, value)
        self._request(lambda sdo: sdo.download(entry.at, entry.subindex, data), what)

    def _request(self, send: Callable[[Any], Any], operation: str) -> bytes:
        limit = self._settings.sdo_timeout
        if not acquire_within(self._one_request, 4.0 * limit):
            raise DeviceTimeout(
                "{device}: {what} found the drive busy with other requests", device=self.who, what=operation
            )
        try:
            sdo = self._sdo
            if self.loss is not None or sdo is None:
                raise _again(self.loss or NotConnected("{device} is not connected", device=self.who))
            try:
                return bytes(send(sdo) or b"")
            except SdoAbortedError as error:
                text = SdoAbortedError.CODES.get(error.code, "unknown reason")
                raise DeviceFault(
                    "{device} refuses {what}: {text} (abort {code:08X}h)",
                    fault_code=f"{error.code:08X}h",
                    device=self.who,
                    what=operation,
                    text=text,
                    code=error.code,
                ) from error
            except SdoCommunicationError as error:
                late = DeviceTimeout(
                    "{device} did not answer {what} within {limit:g} s",
                    str(error),
                    device=self.who,
                    what=operation,
                    limit=limit,
                )
                raise _again(self._lose(late)) from error
            except (can.CanError, OSError) as error:
                lost = ConnectionLost("{device}: the connection to the CAN bus was lost", str(error), device=self.who)
                raise _again(self._lose(lost)) from error
        finally:
            self._one_request.release()

    def heartbeat(self) -> None:
        """Send our heartbeat. Raises ConnectionLost."""
        self._send(HEARTBEAT + self._settings.master_id, OPERATIONAL)

    def start_node(self) -> None:
        """Set the node to Operational (NMT)."""
        self._send(0x000, bytes([NMT_START, self._settings.node_id]))

    def _send(self, identifier: int, data: bytes) -> None:
        network = self._network
        if self.loss is not None or network is None:
            raise _again(self.loss or NotConnected("{device} is not connected", device=self.who))
        try:
            network.send_message(identifier, data)
        except (can.CanError, OSError) as error:
            lost = ConnectionLost("{device}: the connection to the CAN bus was lost", str(error), device=self.who)
            raise _again(self._lose(lost)) from error


def _again(error: DeviceError) -> DeviceError:
    """Return a new error of the same kind, because raising one object in several threads mixes their tracebacks."""
    return type(error)(error.message, error.detail)
