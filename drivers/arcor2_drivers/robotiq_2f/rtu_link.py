"""Modbus RTU on a serial port: one request at a time, each with its time limit."""

import contextlib
import logging
import threading
from collections.abc import Callable
from typing import Final

from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ConnectionException, ModbusException
from pymodbus.pdu import ModbusPDU

from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, NotConnected

from .status import Activation, Command, Object, Status

REQUESTS: Final = 0x03E8
STATUS: Final = 0x07D0
COUNT: Final = 3

# pymodbus logs every failure as an error. Each reaches the caller typed; a device that is off would fill the log.
logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)


def decode(registers: list[int]) -> Status:
    """Read the three status registers. Raises ValueError for what no gripper tells."""
    if len(registers) != COUNT:
        raise ValueError(f"{len(registers)} registers instead of {COUNT}")
    status = registers[0] >> 8
    return Status(
        act=bool(status & 1),
        go_to=bool(status >> 3 & 1),
        activation=Activation(status >> 4 & 3),
        object=Object(status >> 6 & 3),
        fault=registers[1] >> 8 & 0x0F,
        echo=registers[1] & 0xFF,
        position=registers[2] >> 8,
    )


def encode(command: Command, kept: list[int]) -> list[int]:
    """Give the three request registers; what the command leaves open is kept."""
    position = kept[1] & 0xFF if command.position is None else command.position
    speed = kept[2] >> 8 if command.speed is None else command.speed
    force = kept[2] & 0xFF if command.force is None else command.force
    return [(int(command.act) | int(command.go_to) << 3) << 8, position, speed << 8 | force]


class RtuLink:
    """The connection to one gripper. After a missing or senseless answer it is closed, then opened anew and drained."""

    def __init__(self, name: str, port: str, baud_rate: int, unit_id: int, request_timeout: float) -> None:
        self.who = f"{name} at {port} unit {unit_id}"
        self._port, self._baud_rate, self._unit, self._timeout = port, baud_rate, unit_id, request_timeout
        self._one_request = threading.Lock()
        self._client: ModbusSerialClient | None = None
        self._kept = [0] * COUNT

    def open(self, timeout: float) -> None:
        """Open the port; nothing is sent. Raises NotConnected."""
        self.close()
        client = ModbusSerialClient(self._port, baudrate=self._baud_rate, timeout=self._timeout, retries=0)
        with self._one_request:
            if not client.connect():
                raise NotConnected(f"{self.who}: the port cannot be opened: it is absent, or another program uses it")
            if client.socket is not None:
                with contextlib.suppress(OSError):
                    client.socket.reset_input_buffer()
            self._client = client

    def close(self) -> None:
        """Close; harmless when closed. A request that waits for its answer fails at once."""
        client = self._client
        if client is not None and (port := client.socket) is not None:
            with contextlib.suppress(OSError):
                port.close()  # whoever looks for an answer finds it closed
        with self._one_request:
            self._close()

    def _close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            with contextlib.suppress(OSError):
                client.close()  # type: ignore[no-untyped-call]

    def read(self) -> Status:
        """Read the status in one request. Raises DeviceTimeout, ConnectionLost, DeviceFault."""
        answer = self._request(
            lambda c: c.read_holding_registers(STATUS, count=COUNT, device_id=self._unit), "reading the status"
        )
        try:
            return decode(list(answer.registers))
        except ValueError as error:
            raise DeviceFault(f"{self.who} tells what no gripper of this kind tells: {error}") from error

    def write(self, command: Command) -> None:
        """Write all requests at once; never sent a second time."""
        values = encode(command, self._kept)
        self._request(lambda c: c.write_registers(REQUESTS, values, device_id=self._unit), "writing the requests")
        self._kept = values

    def _request(self, send: Callable[[ModbusSerialClient], ModbusPDU], what: str) -> ModbusPDU:
        with self._one_request:
            client = self._client
            if client is None:
                raise NotConnected(f"{self.who} is not connected")
            try:
                answer = send(client)
            except Exception as error:  # decoding foreign bytes may fail in any way
                self._close()
                raise self._told(error, what) from error
        if answer.isError():
            code = int(getattr(answer, "exception_code", 0))
            raise DeviceFault(f"{self.who} refuses {what}: exception {code}", fault_code=code)
        return answer

    def _told(self, error: Exception, what: str) -> DeviceError:
        if isinstance(error, (ConnectionException, OSError, TypeError)):  # TypeError: pyserial, closed under it
            return ConnectionLost(f"{self.who}: the connection was lost: unplugged, or the port was closed", str(error))
        if isinstance(error, ModbusException):
            return DeviceTimeout(f"{self.who}: no valid answer came within {self._timeout:g} s ({what})", str(error))
        return DeviceFault(f"{self.who}: what came is no valid answer ({what})", repr(error))
