"""The bus: the vendor's library with typed errors and time limits. For one thread."""

import contextlib
import termios
import time
from collections.abc import Callable, Iterator
from typing import Any, Final

from dynamixel_sdk import (  # type: ignore[import-untyped]
    COMM_RX_CORRUPT,
    COMM_RX_TIMEOUT,
    COMM_SUCCESS,
    PacketHandler,
    PortHandler,
)

from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotConnected, Refused
from arcor2_hw.keep_alive import KeepAlive, RunningTime
from arcor2_hw.messages import Message, device_at

from .registers import LED, STATUS_ERRORS, Register

POLL: Final = 0.002
"""Time a read waits for bytes, s: the library itself would poll continuously."""
MAX_EXCHANGE_TIME: Final = 0.5
"""Longest exchange, s; the library does not check its own limit while bytes keep arriving."""
WRITE_TIMEOUT: Final = 1.0
"""Time to write a packet, s: long enough for a process that is not scheduled while it writes."""
FIRST_BYTE_TIMEOUT: Final = 0.4
"""Time to wait for the first byte of an answer, s; the library's 0.034 s is too short on a busy computer."""
QUIET_TIME: Final = 0.03
"""Time without bytes after which the line is quiet, s."""
ALERT: Final = 0x80
PKT_ID, PKT_LENGTH_L, PKT_LENGTH_H, PKT_ERROR, PKT_DATA = 4, 5, 6, 8, 9
EMPTY: Final = 4
"""Length field of an answer without data: instruction, error, checksum."""
MIN_ANSWER: Final = 11
"""Size of an answer without data, bytes."""


class _NoFrame(Exception):
    """Bytes keep arriving without forming an answer."""


class _Port(PortHandler):  # type: ignore[misc]
    """The library's port, without continuous polling. Times count only while this process runs."""

    def __init__(self, path: str) -> None:
        super().__init__(path)
        self.begin()

    def begin(self) -> None:
        """Start an exchange."""
        self._clock = RunningTime()
        self._asked = 0.0
        self._heard = False

    def readPort(self, length: int) -> bytes:  # noqa: N802 - the library's name
        if self._clock() > MAX_EXCHANGE_TIME:
            raise _NoFrame
        found: bytes = self.ser.read(max(length, 0))
        self._heard = self._heard or bool(found)
        return found

    def setPacketTimeout(self, packet_length: int) -> None:  # noqa: N802 - the library's name
        super().setPacketTimeout(packet_length)
        self._asked = self._clock()

    def isPacketTimeout(self) -> bool:  # noqa: N802 - the library's name
        limit = float(self.packet_timeout) / 1000.0
        return self._clock() - self._asked > (limit if self._heard else max(limit, FIRST_BYTE_TIMEOUT))


class _Recorder:
    """Replaces a port to record the bytes of a packet."""

    is_using = False
    packet = b""

    def clearPort(self) -> None:  # noqa: N802 - the library's name
        """Do nothing."""

    def writePort(self, packet: list[int]) -> int:  # noqa: N802 - the library's name
        """Record a packet."""
        self.packet = bytes(packet)
        return len(packet)


class Bus:
    """Two servos on one serial port. Each exchange is one instruction and its answers."""

    def __init__(self, name: str, port: str, baud_rate: int) -> None:
        self.who = device_at(name, port)
        self._name, self._path, self._baud_rate = name, port, baud_rate
        self._port: _Port | None = None
        self._packets: Any = PacketHandler(2.0)

    def servo(self, number: int) -> str:
        """Return the name of a servo for errors."""
        return f"servo {number} of {self.who}"

    def open(self) -> None:
        """Open the port exclusively. Raise NotConnected."""
        port = _Port(self._path)
        try:
            port.baudrate = self._baud_rate
            port.openPort()
            port.ser.exclusive = True
            port.ser.timeout = POLL
            port.ser.write_timeout = WRITE_TIMEOUT
        except (OSError, ValueError, termios.error) as e:
            if port.ser is not None:
                with contextlib.suppress(OSError, termios.error):
                    port.ser.close()
            raise NotConnected(
                "{name}: port {path} cannot be opened. Check the cable, and close other programs.",
                str(e),
                name=self._name,
                path=self._path,
            ) from e
        self._port = port
        self.drain()

    def close(self) -> None:
        """Close the port if it is open. `open` creates a new one, as a closed one may report being in use."""
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(OSError, termios.error):
                port.ser.close()

    @contextlib.contextmanager
    def _exchange(self) -> Iterator[_Port]:
        port = self._port
        if port is None:
            raise NotConnected("{device} is not connected", device=self.who)
        port.begin()
        try:
            yield port
        except (OSError, termios.error) as e:
            raise ConnectionLost(
                "The port of {device} has disappeared. Check the cable.", str(e), device=self.who
            ) from e
        except (_NoFrame, IndexError) as e:
            raise DeviceTimeout("{device}: the bytes received are not an answer.", "garbage", device=self.who) from e
        finally:
            port.is_using = False

    def drain(self) -> None:
        """Discard received bytes until the line is quiet."""
        with self._exchange() as port:
            quiet = time.monotonic() + QUIET_TIME
            while time.monotonic() < quiet:
                if port.readPort(256):
                    quiet = time.monotonic() + QUIET_TIME

    def _check(self, number: int, result: int, error: int, operation: str) -> None:
        if result == COMM_RX_TIMEOUT:
            raise DeviceTimeout(
                "{servo} did not answer {what}. Check power and cable.", servo=self.servo(number), what=operation
            )
        if result == COMM_RX_CORRUPT:
            raise DeviceTimeout(
                "The answer of {servo} to {what} was damaged.", servo=self.servo(number), what=operation
            )
        if result != COMM_SUCCESS:
            raise ConnectionLost(
                "{what} could not be sent to {servo}", f"result {result}", what=operation, servo=self.servo(number)
            )
        if error & ~ALERT:
            reason = Message.of(STATUS_ERRORS.get(error & ~ALERT, f"error {error:#04x}"))
            raise Refused(
                "{servo} refuses {what}: {reason}",
                f"status error {error:#04x}",
                servo=self.servo(number),
                what=operation,
                reason=reason,
            )

    def ping(self, number: int) -> int:
        """Return the model number of a servo. Raise DeviceTimeout, Refused, ConnectionLost."""
        with self._exchange() as port:
            model, result, error = self._packets.ping(port, number)
        self._check(number, result, error, "a ping")
        return int(model)

    def _answer(self, port: _Port, number: int, size: int, operation: str) -> bytes:
        """Return the data of a servo's answer. An answer of another length belongs to an earlier instruction."""
        while True:
            packet, result = self._packets.rxPacket(port, False)
            if result != COMM_SUCCESS or packet[PKT_ID] == number:
                break
        self._check(number, result, packet[PKT_ERROR] if result == COMM_SUCCESS else 0, operation)
        found = (packet[PKT_LENGTH_L] | packet[PKT_LENGTH_H] << 8) - EMPTY
        if found != size:
            raise DeviceTimeout(
                "The answer of {servo} to {what} belongs to another instruction.",
                f"{found} bytes",
                servo=self.servo(number),
                what=operation,
            )
        return bytes(packet[PKT_DATA : PKT_DATA + size])

    def read(self, number: int, register: Register) -> bytes:
        """Return the bytes of a register or block. Raise DeviceTimeout, Refused, ConnectionLost."""
        what = f"a reading of register {register.address}"
        with self._exchange() as port:
            sent = self._packets.readTx(port, number, register.address, register.size)
            self._check(number, sent, 0, what)
            return self._answer(port, number, register.size, what)

    def write(self, number: int, register: Register, value: int) -> None:
        """Write a register, with acknowledgement. Raise Refused with the servo's reason."""
        what = f"{value} in register {register.address}"
        data = list((value & ((1 << 8 * register.size) - 1)).to_bytes(register.size, "little"))
        with self._exchange() as port:
            sent = self._packets.writeTxOnly(port, number, register.address, register.size, data)
            self._check(number, sent, 0, what)
            port.setPacketTimeout(MIN_ANSWER)
            self._answer(port, number, 0, what)

    def reboot(self, number: int) -> None:
        """Reboot a servo, which takes some tenths of a second after its answer."""
        with self._exchange() as port:
            result, error = self._packets.reboot(port, number)
        self._check(number, result, error, "a reboot")

    def sync_read(self, numbers: tuple[int, ...], register: Register) -> list[bytes]:
        """Return the same block of each servo, read at one instant."""
        what = f"a reading of register {register.address}"
        with self._exchange() as port:
            sent = self._packets.syncReadTx(port, register.address, register.size, list(numbers), len(numbers), False)
            self._check(numbers[0], sent, 0, what)
            return [self._answer(port, number, register.size, what) for number in numbers]

    def sync_write(self, address: int, blocks: dict[int, bytes]) -> None:
        """Write a block to each servo in one packet, without acknowledgement."""
        size = len(next(iter(blocks.values())))
        data = [byte for number, block in blocks.items() for byte in (number, *block)]
        with self._exchange() as port:
            result = self._packets.syncWriteTxOnly(port, address, size, data, len(data))
        self._check(next(iter(blocks)), result, 0, f"a block at register {address}")

    def keep_alive(self, numbers: tuple[int, ...], period: float, quiet: float) -> KeepAlive:
        """Start a child process that signals the bus watchdog whenever the line is quiet for `quiet` s.

        It writes the unused LEDs: a sync write is not answered, so it disturbs no other answer.
        """
        recorder = _Recorder()
        data = [byte for number in numbers for byte in (number, 0)]
        self._packets.syncWriteTxOnly(recorder, LED.address, LED.size, data, len(data))
        with self._exchange() as port:
            return KeepAlive(port.ser.fileno(), recorder.packet, period, quiet)

    def again(self, ask: Callable[[], Any]) -> Any:
        """Return the result of `ask`; repeat it once, on a quiet line, if the answer was missing or damaged."""
        try:
            return ask()
        except DeviceTimeout:
            self.drain()
            return ask()
