"""Clients of pymodbus with an exact time limit and without polling of the serial port."""

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

MAX_FRAME: Final = 4096
"""Maximum number of bytes of one read. A frame has at most 260."""
GRAIN: Final = 0.002
"""Tolerance of the time limit of a TCP answer, s. The socket option is set again only for a larger difference."""
WAKE_TIMEOUT: Final = 0.05
"""Time in which a thread that waits for a serial port notices that it is being closed, s."""
BITS_PER_CHARACTER: Final = 11
"""Start bit, eight data bits, parity or second stop bit, stop bit (Modbus over serial line 1.02, 2.5.1)."""
SILENCE: Final = 3.5
"""Silence between two frames, characters (Modbus over serial line 1.02, 2.5.1.1)."""
MIN_SILENCE: Final = 0.00175
"""Silence between two frames above 19200 bit/s, s (Modbus over serial line 1.02, 2.5.1.1)."""

# pymodbus logs every failure as an error. Callers get typed errors, and a device that is off would fill the log.
logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)


class _HoldingRegisters(ReadHoldingRegistersResponse):
    """An answer with registers, decoded in one step for speed."""

    def decode(self, data: bytes) -> None:
        """Decode the answer after its function code. Raises ModbusIOException."""
        count, odd = divmod(data[0], 2)
        if odd or len(data) < 1 + data[0]:
            raise ModbusIOException(f"{len(data) - 1} bytes received instead of {data[0]}")
        self.registers = struct.unpack_from(f">{count}H", data, 1)

    def __str__(self) -> str:
        """Return a short description: pymodbus formats each answer for its log, even if it does not log it."""
        return f"answer {self.transaction_id} of {self.dev_id}"


class _InputRegisters(_HoldingRegisters):
    """The same for input registers (function 4)."""

    function_code = 4


class _Exchange(ModbusBaseSyncClient):
    """Send one request and receive its answer within one time limit, without retries."""

    deadline = 0.0
    """Time limit of the complete answer (monotonic, s)."""
    received = False
    """Whether any byte was received since the request was sent."""
    _number = 0

    def register_answers(self) -> None:
        """Register the classes above for answers with registers."""
        self.register(_HoldingRegisters)
        self.register(_InputRegisters)

    def execute(self, no_response_expected: bool, request: ModbusPDU) -> ModbusPDU:
        """Return the answer of a request. Raises ModbusException without an answer, ConnectionException, OSError."""
        self._number = self._number % 0xFFFF + 1
        # RTU frames have no transaction id; the framer returns 0, which is accepted.
        request.transaction_id = self._number
        self.send(self.framer.buildFrame(request))
        received = b""
        while data := self.recv(None):
            received += data
            used, answer = self.framer.handleFrame(received, request.dev_id, self._number)
            if answer is not None:
                return answer
            received = received[used:]
        raise ModbusIOException("no answer in time")


class TcpClient(_Exchange, ModbusTcpClient):
    """A client for Modbus TCP."""

    def __init__(self, host: str, port: int, timeout: float) -> None:
        super().__init__(host, port=port, timeout=timeout, retries=0)
        self._armed = 0.0
        self.register_answers()

    def connect(self) -> bool:
        """Connect within the timeout. Return whether it succeeded."""
        if self.socket is not None:
            return True
        super().connect()  # type: ignore[no-untyped-call]
        socket: sockets.socket | None = self.socket
        if socket is None:
            return False
        # Blocking with time limits in the kernel: this saves the system calls of `select`.
        socket.settimeout(None)
        socket.setsockopt(sockets.SOL_SOCKET, sockets.SO_SNDTIMEO, _timeval(self.comm_params.timeout_connect))
        self._armed = 0.0
        return True

    def recv(self, size: int | None) -> bytes:
        """Return the received bytes, or nothing after the deadline. Raises ConnectionException, OSError."""
        socket = self.socket
        if socket is None:
            raise ConnectionException("the connection was closed")
        if (left := self.deadline - time.monotonic()) <= 0.0:
            return b""
        if not 0.0 <= self._armed - left <= 2.0 * GRAIN:
            self._armed = left + GRAIN
            socket.setsockopt(sockets.SOL_SOCKET, sockets.SO_RCVTIMEO, _timeval(self._armed))
        try:
            data = socket.recv(size or MAX_FRAME)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionException("the other end has closed the connection")
        self.received = True
        return data

    def wake(self) -> None:
        """Make a thread that waits for an answer fail."""
        if (socket := self.socket) is not None:
            socket.shutdown(2)


class SerialClient(_Exchange, ModbusSerialClient):
    """A client for Modbus RTU with eight data bits. It waits for bytes instead of polling every millisecond."""

    def __init__(self, port: str, baudrate: int, parity: str, stopbits: int, timeout: float) -> None:
        super().__init__(
            port, framer=FramerType.RTU, baudrate=baudrate, parity=parity, stopbits=stopbits, timeout=timeout, retries=0
        )
        self._silence = max(SILENCE * BITS_PER_CHARACTER / baudrate, MIN_SILENCE)
        self._last_byte = 0.0
        self._ended = False
        self.register_answers()

    def send(self, request: bytes, addr: tuple[str, int] | None = None) -> int:
        """Send a frame after the required silence since the last frame."""
        if (early := self._last_byte + self._silence - time.monotonic()) > 0.0:
            time.sleep(early)
        return super().send(request, addr)

    def recv(self, size: int | None) -> bytes:
        """Return the received bytes, or nothing after the deadline. Raises ConnectionException, OSError."""
        port = self.socket
        if port is None:
            raise ConnectionException("the connection was closed")
        try:
            waiting = select.poll()
            waiting.register(port.fileno(), select.POLLIN)
        except (AttributeError, io.UnsupportedOperation):  # a port without a file descriptor
            return bytes(super().recv(size))
        while not waiting.poll(1e3 * min(max(self.deadline - time.monotonic(), 0.0), WAKE_TIMEOUT)):
            if self._ended:
                raise ConnectionException("the connection was closed")
            if time.monotonic() >= self.deadline:
                return b""
        # An unplugged port is readable without data; pyserial raises an error then.
        data = bytes(port.read(port.in_waiting or 1))
        self._last_byte = time.monotonic()
        self.received = self.received or bool(data)
        return data

    def wake(self) -> None:
        """Make a thread that waits for an answer fail."""
        self._ended = True


def _timeval(seconds: float) -> bytes:
    """Return a `struct timeval`. It is never zero, which would mean no time limit."""
    return struct.pack("@ll", int(seconds), max(1, int(seconds % 1.0 * 1e6)))


Client = TcpClient | SerialClient


# Names before version 0.2.
LONGEST_FRAME, SHORTEST_SILENCE = MAX_FRAME, MIN_SILENCE
