"""One Modbus connection, TCP or RTU: one request at a time, each with its time limit; a late answer answers nothing."""

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from typing import Final

from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusException
from pymodbus.pdu import ModbusPDU

from arcor2_hw.data.device import Identity
from arcor2_hw.exceptions import ConnectionLost, DeviceFault, DeviceTimeout, NotConnected

from .registers import IMAGE_COUNT, Image, decode
from .settings import BlockSettings

EXCEPTIONS: Final = {
    1: "illegal function",
    2: "illegal address",
    3: "illegal value",
    4: "an expired watchdog holds the output",
    6: "the device is busy",
}
"""Modbus application protocol 1.1b3, section 7; 4 as the block's page says."""

# pymodbus logs every failure as an error. Each reaches the caller typed; a device that is off would fill the log.
logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)

Client = ModbusTcpClient | ModbusSerialClient
Send = Callable[[Client], ModbusPDU]


class _NoAnswer(Exception):
    """No valid answer came in time: whether the request was obeyed is not known."""


class BlockLink:
    """The connection to one block. Requests come from several threads and go out one after the other.

    When no valid answer comes in time the connection is closed and opened again by the next request, so that a late
    answer finds nobody. A serial line carries late answers all the same: there the next request waits for one more
    time-out, which drains the line. When the other end has closed it, requests fail until `open` is called.
    """

    def __init__(self, name: str, settings: BlockSettings) -> None:
        self._settings = settings
        self._serial = bool(settings.serial_port)
        self.who = f"{name} at {settings.serial_port if self._serial else f'{settings.host}:{settings.port}'}"
        self._unit, self._timeout = settings.unit_id, settings.request_timeout
        self._one_request = threading.Lock()
        self._client: Client | None = None
        self._usable = False
        self._loss: ConnectionLost | None = None
        self._received = 0
        self._quiet_until = 0.0

    # -------------------------------------------------------------------------------- life
    def open(self, timeout: float) -> None:
        """Open within `timeout` s. Raises NotConnected, DeviceTimeout."""
        with self._one_request:
            self._close()
            self._open(timeout)
            self._usable, self._loss = True, None

    def close(self) -> None:
        """Close; harmless when closed. A request that waits for its answer fails."""
        self._usable = False
        client = self._client
        if isinstance(client, ModbusTcpClient) and (socket := client.socket) is not None:
            with contextlib.suppress(OSError):  # the other end was quicker
                socket.shutdown(2)  # wakes the thread that waits in it
        with self._one_request:
            self._close()

    def _open(self, timeout: float) -> None:
        settings = self._settings
        client: Client
        if self._serial:
            client = ModbusSerialClient(
                settings.serial_port,
                framer=FramerType.RTU,
                baudrate=settings.baudrate,
                timeout=timeout,
                retries=0,
                trace_packet=self._count_received,
            )
        else:
            client = ModbusTcpClient(
                settings.host, port=settings.port, timeout=timeout, retries=0, trace_packet=self._count_received
            )
        started = time.monotonic()
        if not client.connect():
            if time.monotonic() - started >= timeout:
                raise DeviceTimeout(f"{self.who} did not take the connection within {timeout:.1f} s")
            why = "the port cannot be opened" if self._serial else "nobody takes the connection"
            raise NotConnected(f"{self.who} cannot be reached: {why}")
        self._client = client

    def _close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()  # type: ignore[no-untyped-call]

    def _count_received(self, sending: bool, data: bytes) -> bytes:
        if not sending:
            self._received += len(data)
        return data

    # -------------------------------------------------------------------------------- requests
    def read_image(self, timeout: float | None = None) -> Image:
        """Read the process image, within `timeout` s (else the link's own), asked for twice at most."""
        answer = self._read(
            lambda c: c.read_input_registers(0, count=IMAGE_COUNT, device_id=self._unit), "the process image", timeout
        )
        try:
            return decode(answer.registers)
        except ValueError as error:
            raise DeviceFault(f"{self.who} tells what no block of this kind tells: {error}") from error

    def read_registers(self, address: int, count: int) -> list[int]:
        """Read holding registers."""
        answer = self._read(
            lambda c: c.read_holding_registers(address, count=count, device_id=self._unit),
            f"holding registers {address} to {address + count - 1}",
        )
        return list(answer.registers)

    def write_registers(self, address: int, *values: int, timeout: float | None = None) -> None:
        """Write holding registers in one request; never sent a second time."""
        self._write(
            lambda c: c.write_registers(address, list(values), device_id=self._unit),
            f"a write to register {address}",
            timeout,
        )

    def write_coil(self, address: int, value: bool) -> None:
        """Switch a digital output; never sent a second time."""
        self._write(lambda c: c.write_coil(address, value, device_id=self._unit), f"switching DO{address}", None)

    def identify(self) -> Identity:
        """Read Device Identification (function 43/14), the basic objects."""
        answer = self._read(
            lambda c: c.read_device_information(read_code=1, device_id=self._unit), "the identification"
        )
        told: dict[int, bytes] = getattr(answer, "information", {})
        vendor, product, revision = (bytes(told.get(number, b"")).decode("latin-1") for number in range(3))
        return Identity(vendor=vendor, model=product, firmware=revision)

    def _write(self, send: Send, what: str, timeout: float | None) -> None:
        try:
            self._request(send, what, timeout or self._timeout)
        except _NoAnswer as error:
            raise DeviceTimeout(f"{self.who}: {error}; it may have been obeyed") from error.__cause__

    def _read(self, send: Send, what: str, timeout: float | None = None) -> ModbusPDU:
        """Read; a second time when no answer came, since reading changes nothing."""
        limit = timeout or self._timeout
        try:
            return self._request(send, f"reading {what}", limit)
        except _NoAnswer:
            pass
        try:
            return self._request(send, f"reading {what}, asked twice", limit)
        except _NoAnswer as error:
            raise DeviceTimeout(f"{self.who}: {error}") from error.__cause__

    def _request(self, send: Send, what: str, timeout: float) -> ModbusPDU:
        with self._one_request:
            if not self._usable:
                raise self._loss or NotConnected(f"{self.who} is not connected")
            if self._client is None:
                if (drain := self._quiet_until - time.monotonic()) > 0.0:
                    time.sleep(drain)
                self._open(timeout)
            client = self._client
            assert client is not None
            client.comm_params.timeout_connect = timeout
            self._received = 0
            try:
                answer = send(client)
            except ConnectionException as error:
                raise self._lost(error) from error
            except ModbusException as error:
                self._give_up()
                told = "what came is no valid answer" if self._received else "no answer came"
                raise _NoAnswer(f"{told} within {timeout:g} s ({what})") from error
            except (OSError, ValueError) as error:  # a reset, or a socket closed by `close`
                raise self._lost(error) from error
            except Exception as error:  # decoding foreign bytes may fail in any way
                self._give_up()
                raise _NoAnswer(f"what came is no valid answer ({what}: {type(error).__name__})") from error
        if answer.isError():
            code = int(getattr(answer, "exception_code", 0))
            raise DeviceFault(
                f"{self.who} refuses {what}: {EXCEPTIONS.get(code, 'exception')} (exception {code})", fault_code=code
            )
        return answer

    def _give_up(self) -> None:
        self._close()
        if self._serial:
            self._quiet_until = time.monotonic() + self._timeout

    def _lost(self, error: Exception) -> ConnectionLost:
        self._close()
        self._usable = False
        self._loss = ConnectionLost(f"{self.who}: the connection was lost", f"{type(error).__name__}: {error}")
        return self._loss
