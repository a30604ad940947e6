"""pymodbus's clients with what a driver needs of them: an exact time limit, and no polling of a serial port."""

import io
import logging
import select
import socket as sockets
import struct
import time
from typing import Final

from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.client.base import ModbusBaseSyncClient
from pymodbus.exceptions import ConnectionException, ModbusException, ModbusIOException
from pymodbus.pdu import ModbusPDU
from pymodbus.pdu.register_message import ReadHoldingRegistersResponse

__all__ = ["Client", "ConnectionException", "ModbusException", "ModbusPDU", "SerialClient", "TcpClient"]

LONGEST_FRAME: Final = 4096
"""Bytes taken at once; a frame has 260 at most."""
GRAIN: Final = 0.002
"""s by which a TCP answer may come too late: the kernel's limit is set anew only when it is wrong by more than this."""
WAKE_WITHIN: Final = 0.05
"""Time within which a thread that waits on a serial port notices that it is being closed, s."""
BITS_OF_A_CHARACTER: Final = 11
"""Modbus over serial line 1.02, 2.5.1: start, eight, parity or a second stop bit, stop."""
SILENCE: Final = 3.5
"""Characters of silence between two frames (Modbus over serial line 1.02, 2.5.1.1)."""
SHORTEST_SILENCE: Final = 0.00175
"""s; the same place fixes it so beyond 19200 bit/s."""

# pymodbus logs every failure as an error. Each reaches the caller typed; a device that is off would fill the log.
logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)


class _HoldingRegisters(ReadHoldingRegistersResponse):
    """An answer of registers, taken apart in one step instead of one by one."""

    def decode(self, data: bytes) -> None:
        """Take the answer apart after its function code. Raises ModbusIOException, which the decoder makes of it."""
        count, odd = divmod(data[0], 2)
        if odd or len(data) < 1 + data[0]:
            raise ModbusIOException(f"{len(data) - 1} bytes came where {data[0]} were announced")
        self.registers = struct.unpack_from(f">{count}H", data, 1)

    def __str__(self) -> str:
        """Give a name; the library asks for it at every answer, and throws it away unless it logs all."""
        return f"answer {self.transaction_id} of {self.dev_id}"


class _InputRegisters(_HoldingRegisters):
    """As above, function 4."""

    function_code = 4


class _Exchange(ModbusBaseSyncClient):
    """One request, one answer, one time limit: no retries, no state from one request to the next but its number."""

    deadline = 0.0
    """When waiting for an answer ends, however it dribbles in (monotonic, s)."""
    received = False
    """Whether anything has come since the request was sent."""
    _number = 0

    def know(self) -> None:
        """Have answers of registers decoded by the classes above."""
        self.register(_HoldingRegisters)
        self.register(_InputRegisters)

    def execute(self, no_response_expected: bool, request: ModbusPDU) -> ModbusPDU:
        """Give the answer of this very request. Raises ModbusException without one, ConnectionException, OSError."""
        self._number = self._number % 0xFFFF + 1
        # A serial line knows no numbers; its framer gives 0, which the comparison lets pass.
        request.transaction_id = self._number
        self.send(self.framer.buildFrame(request))
        came = b""
        while data := self.recv(None):
            came += data
            used, answer = self.framer.handleFrame(came, request.dev_id, self._number)
            if answer is not None:
                return answer
            came = came[used:]
        raise ModbusIOException("no answer in time")


class TcpClient(_Exchange, ModbusTcpClient):
    """Modbus TCP."""

    def __init__(self, host: str, port: int, timeout: float) -> None:
        super().__init__(host, port=port, timeout=timeout, retries=0)
        self._armed = 0.0
        self.know()

    def connect(self) -> bool:
        """Connect within the time-out; tell whether that went well."""
        if self.socket is not None:
            return True
        super().connect()  # type: ignore[no-untyped-call]
        socket: sockets.socket | None = self.socket
        if socket is None:
            return False
        # Blocking, with the limits kept by the kernel: one call each for sending and receiving instead of two or three.
        socket.settimeout(None)
        socket.setsockopt(sockets.SOL_SOCKET, sockets.SO_SNDTIMEO, _timeval(self.comm_params.timeout_connect))
        self._armed = 0.0
        return True

    def recv(self, size: int | None) -> bytes:
        """Give what is there, nothing when the deadline has passed. Raises ConnectionException, OSError."""
        socket = self.socket
        if socket is None:
            raise ConnectionException("closed meanwhile")
        if (left := self.deadline - time.monotonic()) <= 0.0:
            return b""
        if not 0.0 <= self._armed - left <= 2.0 * GRAIN:
            self._armed = left + GRAIN
            socket.setsockopt(sockets.SOL_SOCKET, sockets.SO_RCVTIMEO, _timeval(self._armed))
        try:
            data = socket.recv(size or LONGEST_FRAME)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionException("the other end has closed the connection")
        self.received = True
        return data

    def wake(self) -> None:
        """Let a thread that waits for an answer fail."""
        if (socket := self.socket) is not None:
            socket.shutdown(2)


class SerialClient(_Exchange, ModbusSerialClient):
    """Modbus RTU with eight data bits. Waits for bytes instead of asking each millisecond whether there are any."""

    def __init__(self, port: str, baudrate: int, parity: str, stopbits: int, timeout: float) -> None:
        super().__init__(
            port,
            framer=FramerType.RTU,
            baudrate=baudrate,
            parity=parity,
            stopbits=stopbits,
            timeout=timeout,
            retries=0,
        )
        self._silence = max(SILENCE * BITS_OF_A_CHARACTER / baudrate, SHORTEST_SILENCE)
        self._last_byte = 0.0
        self._ended = False
        self.know()

    def send(self, request: bytes, addr: tuple[str, int] | None = None) -> int:
        """Send a frame, after the silence that parts it from the last."""
        if (early := self._last_byte + self._silence - time.monotonic()) > 0.0:
            time.sleep(early)
        return super().send(request, addr)

    def recv(self, size: int | None) -> bytes:
        """Give what is there, nothing when the deadline has passed. Raises ConnectionException, OSError."""
        port = self.socket
        if port is None:
            raise ConnectionException("closed meanwhile")
        try:
            waiting = select.poll()
            waiting.register(port.fileno(), select.POLLIN)
        except (AttributeError, io.UnsupportedOperation):  # a port that is no file
            return bytes(super().recv(size))
        while not waiting.poll(1e3 * min(max(self.deadline - time.monotonic(), 0.0), WAKE_WITHIN)):
            if self._ended:
                raise ConnectionException("closed meanwhile")
            if time.monotonic() >= self.deadline:
                return b""
        # A port that was unplugged is readable and has nothing: pyserial tells so.
        data = bytes(port.read(port.in_waiting or 1))
        self._last_byte = time.monotonic()
        self.received = self.received or bool(data)
        return data

    def wake(self) -> None:
        """Let a thread that waits for an answer fail."""
        self._ended = True


def _timeval(seconds: float) -> bytes:
    """Give a `struct timeval`; never zero, which would mean to wait for ever."""
    return struct.pack("@ll", int(seconds), max(1, int(seconds % 1.0 * 1e6)))


Client = TcpClient | SerialClient
