"""Modbus devices on the wires of the fakes: tables, the requests on them, and frames on TCP and RTU.

Written from MODBUS Application Protocol V1.1b3, MODBUS Messaging on TCP/IP Implementation Guide V1.0b, and MODBUS over
Serial Line V1.02.
"""

import asyncio
import struct
from collections.abc import Callable, Container, Iterator, Sequence
from enum import IntEnum
from pathlib import Path
from typing import ClassVar, Final

from arcor2_fakes.serial_line import PtyLine
from arcor2_fakes.wire import Connection, TcpWire

SILENCE: Final = 0.05
"""Silence that ends an RTU frame, s. On a real line it is 3.5 characters; the host of a pty may be scheduled late."""
_MAX_RTU_FRAME: Final = 256
_BROADCAST: Final = 0
_TCP_UNITS: Final = (0, 255)
"""Unit ids with which a TCP host addresses the device at this IP address, besides the device's own."""
_MAX_BITS_READ, _MAX_BITS_WRITTEN, _MAX_READ, _MAX_WRITTEN, _MAX_WRITTEN_WITH_READ = 2000, 1968, 125, 123, 121
_COIL_ON: Final = 0xFF00
_READ_IDENTIFICATION: Final = 0x0E
_CONFORMITY: Final = 0x82
"""Regular identification, by stream and by object."""
_TABLES: Final = {1: "coils", 2: "discrete_inputs", 3: "holding_registers", 4: "input_registers"} | {
    5: "coils",
    6: "holding_registers",
    15: "coils",
    16: "holding_registers",
    22: "holding_registers",
    23: "holding_registers",
    43: "identity",
}
"""Attribute of a device that a function requires."""
_REQUESTS: Final = (
    dict.fromkeys(range(1, 7), (8, 0))
    | dict.fromkeys((15, 16), (9, 6))
    | {
        22: (10, 0),
        23: (13, 10),
        43: (7, 0),
    }
)
_ANSWERS: Final = dict.fromkeys((1, 2, 3, 4, 23), (5, 2)) | dict.fromkeys((5, 6, 15, 16), (8, 0)) | {22: (10, 0)}
"""RTU frames by function: length in bytes, and the place of a byte with the number of further bytes (0: none)."""


class ExceptionCode(IntEnum):
    """Code of an exception."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_ADDRESS = 2
    ILLEGAL_VALUE = 3
    DEVICE_FAILURE = 4
    DEVICE_BUSY = 6
    NO_TARGET = 11


class ModbusRefusal(Exception):
    """The device answers a request with an exception."""

    def __init__(self, code: ExceptionCode) -> None:
        self.code = code


class ModbusTables:
    """The tables of a simulated device. A subclass declares their sizes and overrides the methods of those it has.

    Each method may raise `ModbusRefusal`. Requests outside of a table never reach them.

    Class Attributes:
        unit: Unit id of the device.
        functions: Functions of the device, if it has their tables.
        identity: Vendor, product code, revision and product name (function 43/14); empty without this function.
        coils, discrete_inputs, holding_registers, input_registers: Sizes of the tables; 0 without its functions.
    """

    unit: ClassVar[int] = 1
    functions: ClassVar[Container[int]] = _TABLES
    identity: ClassVar[tuple[str, ...]] = ()
    coils: ClassVar[int] = 0
    discrete_inputs: ClassVar[int] = 0
    holding_registers: ClassVar[int] = 0
    input_registers: ClassVar[int] = 0

    def read_coils(self) -> Sequence[bool]:
        """Return all coils."""
        raise NotImplementedError

    def write_coils(self, address: int, values: list[bool]) -> None:
        """Switch coils."""
        raise NotImplementedError

    def read_discrete_inputs(self) -> Sequence[bool]:
        """Return all discrete inputs."""
        raise NotImplementedError

    def read_input_registers(self) -> Sequence[int]:
        """Return all input registers. The lower 16 bits of longer numbers are used."""
        raise NotImplementedError

    def read_holding_register(self, address: int) -> int:  # noqa: ARG002 - they cannot be read
        """Return a holding register. The lower 16 bits of a longer number are used."""
        return 0

    def read_registers(self, function: int, address: int, count: int) -> Sequence[int]:
        """Return the registers of a read: input registers for function 4, holding registers for others."""
        if function == 4:
            return self.read_input_registers()[address : address + count]
        return [self.read_holding_register(each) for each in range(address, address + count)]

    def write_holding_registers(self, address: int, values: list[int]) -> None:
        """Write holding registers, all or none."""
        raise NotImplementedError

    def request_arrived(self) -> None:
        """Advance the simulation before a request is executed."""

    def answer(self, request: bytes) -> bytes:
        """Execute a request and return the answer; both are a function and its data."""
        self.request_arrived()
        function, data = request[0], request[1:]
        try:
            if function not in self.functions or not getattr(self, _TABLES[function]):
                raise ModbusRefusal(ExceptionCode.ILLEGAL_FUNCTION)
            return bytes((function,)) + self._execute(function, data)
        except struct.error:
            return _exception(function, ExceptionCode.ILLEGAL_VALUE)  # too short or too long
        except ModbusRefusal as refusal:
            return _exception(function, refusal.code)

    def _execute(self, function: int, data: bytes) -> bytes:
        match function:
            case 1 | 2:
                first, count = self._checked(function, _MAX_BITS_READ, *struct.unpack(">HH", data))
                bits = self.read_coils() if function == 1 else self.read_discrete_inputs()
                return _with_length(_packed(bits[first : first + count]))
            case 3 | 4:
                return self._read_registers(function, *struct.unpack(">HH", data))
            case 5:
                address, value = struct.unpack(">HH", data)
                _check(value in (0, _COIL_ON))
                self._checked(function, 1, address, 1)
                self.write_coils(address, [value == _COIL_ON])
            case 6:
                address, value = struct.unpack(">HH", data)
                self._checked(function, 1, address, 1)
                self.write_holding_registers(address, [value])
            case 15:
                address, count, size = struct.unpack_from(">HHB", data)
                _check(size == (count + 7) // 8 == len(data) - 5)
                self._checked(function, _MAX_BITS_WRITTEN, address, count)
                packed = int.from_bytes(data[5:], "little")
                self.write_coils(address, [bool(packed >> place & 1) for place in range(count)])
                return data[:4]
            case 16:
                self._write_registers(function, data, _MAX_WRITTEN)
                return data[:4]
            case 22:
                address, kept, set_ = struct.unpack(">HHH", data)
                self._checked(function, 1, address, 1)
                value = self.read_holding_register(address) & 0xFFFF
                self.write_holding_registers(address, [value & kept | set_ & ~kept & 0xFFFF])
            case 23:
                first, count, _, written, size = struct.unpack_from(">HHHHB", data)
                _check(1 <= written <= _MAX_WRITTEN_WITH_READ and size == 2 * written)
                self._checked(function, _MAX_READ, first, count)
                self._write_registers(function, data[4:], _MAX_WRITTEN_WITH_READ)
                return self._read_registers(function, first, count)
            case _:
                return self._identification(data)
        return data

    def _checked(self, function: int, most: int, address: int, count: int) -> tuple[int, int]:
        """Return address and count of a request, after checking them in the order of the standard."""
        _check(1 <= count <= most)
        if address + count > getattr(self, _TABLES[function]):
            raise ModbusRefusal(ExceptionCode.ILLEGAL_ADDRESS)
        return address, count

    def _read_registers(self, function: int, address: int, count: int) -> bytes:
        self._checked(function, _MAX_READ, address, count)
        words = self.read_registers(function, address, count)
        return _with_length(b"".join((word & 0xFFFF).to_bytes(2) for word in words))

    def _write_registers(self, function: int, data: bytes, most: int) -> None:
        address, count, size = struct.unpack_from(">HHB", data)
        _check(size == 2 * count == len(data) - 5)
        self._checked(function, most, address, count)
        self.write_holding_registers(address, list(struct.unpack_from(f">{count}H", data, 5)))

    def _identification(self, data: bytes) -> bytes:
        """Return the objects of Read Device Identification (43/14)."""
        if data[:1] != bytes((_READ_IDENTIFICATION,)):
            raise ModbusRefusal(ExceptionCode.ILLEGAL_FUNCTION)
        _, category, first = struct.unpack(">3B", data)
        objects = dict(zip((0, 1, 2, 4), self.identity, strict=True))
        _check(category in (1, 2, 3, 4))
        if category == 4 and first not in objects:
            raise ModbusRefusal(ExceptionCode.ILLEGAL_ADDRESS)
        first = first if first in objects else 0
        last = {1: 2, 4: first}.get(category, max(objects))
        shown = [(number, text.encode()) for number, text in objects.items() if first <= number <= last]
        listed = b"".join(bytes((number, len(text))) + text for number, text in shown)
        return bytes((_READ_IDENTIFICATION, category, _CONFORMITY, 0, 0, len(shown))) + listed


def _check(valid: bool) -> None:
    if not valid:
        raise ModbusRefusal(ExceptionCode.ILLEGAL_VALUE)


def _exception(function: int, code: ExceptionCode) -> bytes:
    return bytes((function | 0x80, code))


def _with_length(data: bytes) -> bytes:
    return bytes((len(data),)) + data


def _packed(bits: Sequence[bool]) -> bytes:
    return sum(bool(bit) << place for place, bit in enumerate(bits)).to_bytes((len(bits) + 7) // 8, "little")


def tcp_wire(
    tables: ModbusTables,
    host: str,
    port: int,
    name: str = "modbus",
    trace: Callable[[bool, bytes], object] = lambda _to_host, _frame: None,
) -> TcpWire:
    """Return a TCP port on which a device answers; `trace` is called with each frame and whether it is to the host.

    The device answers to its own unit id, 0 and 255. To others it answers as a gateway without such a unit. A frame of
    another protocol is dropped; after one of an impossible length the connection is closed.
    """

    def opened(connection: Connection) -> None:
        buffer = bytearray()

        def received(data: bytes) -> None:
            buffer.extend(data)
            while len(buffer) >= 7:
                transaction, protocol, length, unit = struct.unpack_from(">HHHB", buffer)
                if not 2 <= length <= 254:
                    buffer.clear()
                    connection.close()
                    return
                if len(buffer) < 6 + length:
                    return
                frame = bytes(buffer[: 6 + length])
                del buffer[: 6 + length]
                if protocol == 0:
                    trace(False, frame)
                    own = unit == tables.unit or unit in _TCP_UNITS
                    answer = tables.answer(frame[7:]) if own else _exception(frame[7], ExceptionCode.NO_TARGET)
                    frame = struct.pack(">HHHB", transaction, 0, len(answer) + 1, unit) + answer
                    trace(True, frame)
                    connection.send(frame)

        connection.received = received

    return TcpWire(name, host, port, opened)


class RtuFrames:
    """Receives the bytes of an RTU line: frames for the device are executed and answered, all others are ignored.

    A frame ends with its checksum, or with silence. Broadcasts are executed and not answered.
    """

    def __init__(self, tables: ModbusTables, send: Callable[[bytes], object]) -> None:
        self._tables, self._send = tables, send
        self._loop = asyncio.get_running_loop()
        self._buffer = bytearray()
        self._timer: asyncio.TimerHandle | None = None

    def received(self, data: bytes) -> None:
        """Receive bytes."""
        if self._timer is not None:
            self._timer.cancel()
            if self._loop.time() >= self._timer.when():
                self._silent()
        self._buffer += data
        while length := next((each for each in self._lengths() if is_frame(self._buffer[:each])), 0):
            frame = bytes(self._buffer[:length])
            del self._buffer[:length]
            self._execute(frame)
        del self._buffer[_MAX_RTU_FRAME + 1 :]
        self._timer = self._loop.call_later(SILENCE, self._silent) if self._buffer else None

    def _silent(self) -> None:
        """End the current frame."""
        frame = bytes(self._buffer)
        self._buffer.clear()
        self._timer = None
        if is_frame(frame):
            self._execute(frame)

    def _lengths(self) -> Iterator[int]:
        """Return the possible lengths of the next frame: as a request, and as the answer of another unit."""
        data = self._buffer
        for lengths in (_REQUESTS, {} if data[:1] == bytes((self._tables.unit,)) else _ANSWERS):
            fixed, count_at = lengths.get(data[1], (5 if data[1] & 0x80 else 0, 0)) if len(data) > 1 else (0, 0)
            length = fixed + (data[count_at] if 0 < count_at < len(data) else 0)
            if fixed and count_at < len(data) and length <= len(data):
                yield length

    def _execute(self, frame: bytes) -> None:
        if frame[0] in (self._tables.unit, _BROADCAST):
            answer = frame[:1] + self._tables.answer(frame[1:-2])
            if frame[0] != _BROADCAST:
                self._send(answer + struct.pack("<H", _checksum(answer)))


def _checksum(data: bytes) -> int:
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value


def is_frame(data: bytes | bytearray) -> bool:
    """Return whether bytes are a complete RTU frame: unit, function, data and checksum."""
    return len(data) >= 4 and _checksum(bytes(data)) == 0


def serial_line(tables: ModbusTables, link: Path | None = None) -> PtyLine:
    """Return a pty on which a device answers by RTU."""
    frames = RtuFrames(tables, lambda frame: line.send(frame))
    line = PtyLine(frames.received, link)
    return line
