"""The bus: the vendor's library with typed errors and time limits. For one thread alone."""

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

from .registers import LED, STATUS_ERRORS, Register

POLL: Final = 0.002
"""s for which a read waits for bytes: the library alone would spin."""
LONGEST: Final = 0.35
"""s for one exchange whatever comes; the library's own limit is not looked at while bytes keep coming."""
WRITE_TIMEOUT: Final = 1.0
"""s to write a packet. A process that stands still in writing must not take that for a port that is stuck."""
PATIENCE: Final = 0.25
"""s that the first byte of an answer is waited for; the library's 0.034 are few on a busy computer."""
QUIET: Final = 0.03
"""s for which what comes late is thrown away before something is asked anew."""
ALERT: Final = 0x80
PKT_ID, PKT_LENGTH_L, PKT_LENGTH_H, PKT_ERROR, PKT_DATA = 4, 5, 6, 8, 9
EMPTY: Final = 4
"""What the length field says of an answer without data: instruction, error, checksum."""
SHORTEST: Final = 11
"""Bytes of an answer without data."""


class _Endless(Exception):
    """Bytes keep coming and none of them is an answer."""


class _Port(PortHandler):  # type: ignore[misc]
    """The library's port, waiting instead of spinning. Times are running time: an answer waits while we do not run."""

    def __init__(self, path: str) -> None:
        super().__init__(path)
        self.begin()

    def begin(self) -> None:
        """Begin an exchange."""
        self._clock = RunningTime()
        self._asked = 0.0
        self._heard = False

    def readPort(self, length: int) -> bytes:  # noqa: N802 - the library's name
        if self._clock() > LONGEST:
            raise _Endless
        found: bytes = self.ser.read(max(length, 0))
        self._heard = self._heard or bool(found)
        return found

    def setPacketTimeout(self, packet_length: int) -> None:  # noqa: N802 - the library's name
        super().setPacketTimeout(packet_length)
        self._asked = self._clock()

    def isPacketTimeout(self) -> bool:  # noqa: N802 - the library's name
        limit = float(self.packet_timeout) / 1000.0
        return self._clock() - self._asked > (limit if self._heard else max(limit, PATIENCE))


class _Recorder:
    """In place of a port: takes the bytes of a packet."""

    is_using = False
    packet = b""

    def clearPort(self) -> None:  # noqa: N802 - the library's name
        """Clear nothing."""

    def writePort(self, packet: list[int]) -> int:  # noqa: N802 - the library's name
        """Take a packet."""
        self.packet = bytes(packet)
        return len(packet)


class Bus:
    """Two servos on one serial port. Each exchange is one instruction and its answers."""

    def __init__(self, name: str, port: str, baud_rate: int) -> None:
        self.who = f"{name} at {port}"
        self._name, self._path, self._baud_rate = name, port, baud_rate
        self._port: _Port | None = None
        self._packets: Any = PacketHandler(2.0)

    def servo(self, number: int) -> str:
        """Name a servo in an error."""
        return f"servo {number} of {self.who}"

    def open(self) -> None:
        """Open the port for us alone. Raises NotConnected naming it."""
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
            raise NotConnected(f"{self._name}: port {self._path} cannot be opened", str(e)) from e
        self._port = port
        self.drain()

    def close(self) -> None:
        """Close; harmless when closed. The next `open` makes a new port: this one may say for ever that it is used."""
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(OSError, termios.error):
                port.ser.close()

    @contextlib.contextmanager
    def _exchange(self) -> Iterator[_Port]:
        port = self._port
        if port is None:
            raise NotConnected(f"{self.who} is not connected")
        port.begin()
        try:
            yield port
        except (OSError, termios.error) as e:
            raise ConnectionLost(f"the port of {self.who} is gone", str(e)) from e
        except (_Endless, IndexError) as e:
            raise DeviceTimeout(f"{self.who}: what comes on the line is no answer", "garbage") from e
        finally:
            port.is_using = False

    def drain(self) -> None:
        """Throw away what still comes, until nothing has come for a moment."""
        with self._exchange() as port:
            quiet = time.monotonic() + QUIET
            while time.monotonic() < quiet:
                if port.readPort(256):
                    quiet = time.monotonic() + QUIET

    def _check(self, number: int, result: int, error: int, what: str) -> None:
        if result == COMM_RX_TIMEOUT:
            raise DeviceTimeout(f"{self.servo(number)} did not answer {what}")
        if result == COMM_RX_CORRUPT:
            raise DeviceTimeout(f"the answer of {self.servo(number)} to {what} was damaged")
        if result != COMM_SUCCESS:
            raise ConnectionLost(f"{what} could not be sent to {self.servo(number)}", f"result {result}")
        if error & ~ALERT:
            reason = STATUS_ERRORS.get(error & ~ALERT, f"error {error:#04x}")
            raise Refused(f"{self.servo(number)} refuses {what}: {reason}", f"status error {error:#04x}")

    def ping(self, number: int) -> int:
        """Give the model number. Raises DeviceTimeout, Refused, ConnectionLost, each naming the servo."""
        with self._exchange() as port:
            model, result, error = self._packets.ping(port, number)
        self._check(number, result, error, "a ping")
        return int(model)

    def _answer(self, port: _Port, number: int, size: int, what: str) -> bytes:
        """Give the data of a servo's answer. One of another length is a late answer to something else."""
        while True:
            packet, result = self._packets.rxPacket(port, False)
            if result != COMM_SUCCESS or packet[PKT_ID] == number:
                break
        self._check(number, result, packet[PKT_ERROR] if result == COMM_SUCCESS else 0, what)
        found = (packet[PKT_LENGTH_L] | packet[PKT_LENGTH_H] << 8) - EMPTY
        if found != size:
            raise DeviceTimeout(f"the answer of {self.servo(number)} to {what} was another one's", f"{found} bytes")
        return bytes(packet[PKT_DATA : PKT_DATA + size])

    def read(self, number: int, register: Register) -> bytes:
        """Give the bytes of a register or block. Raises DeviceTimeout, Refused, ConnectionLost, naming the servo."""
        what = f"a reading of register {register.address}"
        with self._exchange() as port:
            sent = self._packets.readTx(port, number, register.address, register.size)
            self._check(number, sent, 0, what)
            return self._answer(port, number, register.size, what)

    def write(self, number: int, register: Register, value: int) -> None:
        """Write a register and have it acknowledged. Raises Refused with what the servo says."""
        what = f"{value} in register {register.address}"
        data = list((value & ((1 << 8 * register.size) - 1)).to_bytes(register.size, "little"))
        with self._exchange() as port:
            sent = self._packets.writeTxOnly(port, number, register.address, register.size, data)
            self._check(number, sent, 0, what)
            port.setPacketTimeout(SHORTEST)
            self._answer(port, number, 0, what)

    def reboot(self, number: int) -> None:
        """Reboot a servo; it answers and is away for some tenths of a second."""
        with self._exchange() as port:
            result, error = self._packets.reboot(port, number)
        self._check(number, result, error, "a reboot")

    def sync_read(self, numbers: tuple[int, ...], register: Register) -> list[bytes]:
        """Give the same block of each servo, of one instant."""
        what = f"a reading of register {register.address}"
        with self._exchange() as port:
            sent = self._packets.syncReadTx(port, register.address, register.size, list(numbers), len(numbers), False)
            self._check(numbers[0], sent, 0, what)
            return [self._answer(port, number, register.size, what) for number in numbers]

    def sync_write(self, address: int, blocks: dict[int, bytes]) -> None:
        """Write a block to each servo in one packet; nobody acknowledges it."""
        size = len(next(iter(blocks.values())))
        data = [byte for number, block in blocks.items() for byte in (number, *block)]
        with self._exchange() as port:
            result = self._packets.syncWriteTxOnly(port, address, size, data, len(data))
        self._check(next(iter(blocks)), result, 0, f"a block at register {address}")

    def keep_alive(self, numbers: tuple[int, ...], period: float, quiet: float) -> KeepAlive:
        """Keep the servos' bus watchdog quiet from a child process when the line is quiet for `quiet` s.

        It writes the LEDs, which nothing here uses: nobody answers a sync write, so no answer of ours is disturbed.
        """
        recorder = _Recorder()
        data = [byte for number in numbers for byte in (number, 0)]
        self._packets.syncWriteTxOnly(recorder, LED.address, LED.size, data, len(data))
        with self._exchange() as port:
            return KeepAlive(port.ser.fileno(), recorder.packet, period, quiet)

    def again(self, ask: Callable[[], Any]) -> Any:
        """Give what `ask` gives; ask a second time, on a quiet line, when the answer was missing or damaged."""
        try:
            return ask()
        except DeviceTimeout:
            self.drain()
            return ask()
