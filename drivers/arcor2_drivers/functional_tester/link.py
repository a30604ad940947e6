"""One Modbus TCP connection: one request at a time, each with its time limit; a late answer answers nothing."""

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from typing import Final

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusException
from pymodbus.pdu import ModbusPDU

from arcor2_hw.data.device import Identity
from arcor2_hw.exceptions import ConnectionLost, DeviceFault, DeviceTimeout, NotConnected

from .registers import DISCRETE_COUNT, HOLDING_COUNT, INPUT_COUNT, Inputs, decode

EXCEPTIONS: Final = {
    1: "illegal function",
    2: "illegal address",
    3: "illegal value",
    4: "failure of the device",
    6: "the device is busy",
}
"""Modbus application protocol 1.1b3, section 7."""

# pymodbus logs every failure as an error. Each reaches the caller typed; a device that is off would fill the log.
logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)

Send = Callable[[ModbusTcpClient], ModbusPDU]


class _NoAnswer(Exception):
    """No valid answer came in time: whether the request was obeyed is not known."""


class ModbusLink:
    """The connection to one tester. Requests come from several threads and go out one after the other.

    When no valid answer comes in time the socket is closed, so that a late answer finds nobody, and the next request
    opens it again. When the other end has closed it, requests fail until `open` is called.
    """

    def __init__(self, name: str, host: str, port: int, unit_id: int, request_timeout: float) -> None:
        self.who = f"{name} at {host}:{port}"
        self._host, self._port, self._unit = host, port, unit_id
        self._timeout = request_timeout
        self._one_request = threading.Lock()
        self._client: ModbusTcpClient | None = None
        self._usable = False
        self._loss: ConnectionLost | None = None
        self._received = 0
        self.sent = 0.0
        """When the last request was sent, on the monotonic clock."""

    # -------------------------------------------------------------------------------- life
    def open(self, timeout: float) -> None:
        """Open within `timeout` s. Raises NotConnected, DeviceTimeout."""
        with self._one_request:
            self._close()
            self._open(timeout)
            self._usable, self._loss = True, None

    def close(self) -> None:
        """Close; harmless when closed. A request that waits for its answer fails at once."""
        self._usable = False
        client = self._client
        if client is not None and (socket := client.socket) is not None:
            with contextlib.suppress(OSError):  # the other end was quicker
                socket.shutdown(2)  # wakes the thread that waits in it
        with self._one_request:
            self._close()

    def _open(self, timeout: float) -> None:
        client = ModbusTcpClient(
            self._host, port=self._port, timeout=timeout, retries=0, trace_packet=self._count_received
        )
        started = time.monotonic()
        if not client.connect():  # type: ignore[no-untyped-call]
            if time.monotonic() - started >= timeout:
                raise DeviceTimeout(f"{self.who} did not take the connection within {timeout:.1f} s")
            raise NotConnected(f"{self.who} cannot be reached: nobody takes the connection")
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
    def read_inputs(self, timeout: float | None = None) -> Inputs:
        """Read all input registers and discrete inputs, within `timeout` s (else the link's own) each."""
        registers = self._read(
            lambda c: c.read_input_registers(0, count=INPUT_COUNT, device_id=self._unit), "the input registers", timeout
        )
        bits = self._read(
            lambda c: c.read_discrete_inputs(0, count=DISCRETE_COUNT, device_id=self._unit),
            "the discrete inputs",
            timeout,
        )
        try:
            return decode(registers.registers, bits.bits)
        except ValueError as error:
            raise DeviceFault(f"{self.who} tells what no tester of this kind tells: {error}") from error

    def read_holding(self) -> list[int]:
        """Read all holding registers."""
        answer = self._read(
            lambda c: c.read_holding_registers(0, count=HOLDING_COUNT, device_id=self._unit), "the holding registers"
        )
        if len(answer.registers) != HOLDING_COUNT:
            raise DeviceFault(f"{self.who} gave {len(answer.registers)} of {HOLDING_COUNT} holding registers")
        return list(answer.registers)

    def write(self, address: int, *values: int, timeout: float | None = None) -> None:
        """Write holding registers in one request; never sent a second time."""
        what = f"a write to register {int(address)}"
        try:
            self._request(
                lambda c: c.write_registers(address, [int(value) for value in values], device_id=self._unit),
                what,
                timeout or self._timeout,
            )
        except _NoAnswer as error:
            raise DeviceTimeout(f"{self.who}: {error}; it may have been obeyed") from error.__cause__

    def identify(self) -> Identity:
        """Read Device Identification (function 43/14), the basic objects."""
        answer = self._read(
            lambda c: c.read_device_information(read_code=1, device_id=self._unit), "the identification"
        )
        told: dict[int, bytes] = getattr(answer, "information", {})
        vendor, product, revision = (bytes(told.get(number, b"")).decode("latin-1") for number in range(3))
        return Identity(vendor=vendor, model=product, firmware=revision)

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
                self._open(timeout)
            client = self._client
            assert client is not None
            client.comm_params.timeout_connect = timeout
            self._received = 0
            self.sent = time.monotonic()
            try:
                answer = send(client)
            except ConnectionException as error:
                raise self._lost(error) from error
            except ModbusException as error:
                self._close()
                told = "what came is no valid answer" if self._received else "no answer came"
                raise _NoAnswer(f"{told} within {timeout:g} s ({what})") from error
            except (OSError, ValueError) as error:  # a reset, or a socket closed by `close`
                raise self._lost(error) from error
            except Exception as error:  # decoding foreign bytes may fail in any way
                self._close()
                raise _NoAnswer(f"what came is no valid answer ({what}: {type(error).__name__})") from error
        if answer.isError():
            code = int(getattr(answer, "exception_code", 0))
            raise DeviceFault(
                f"{self.who} refuses {what}: {EXCEPTIONS.get(code, 'exception')} (exception {code})", fault_code=code
            )
        return answer

    def _lost(self, error: Exception) -> ConnectionLost:
        self._close()
        self._usable = False
        self._loss = ConnectionLost(f"{self.who}: the connection was lost", f"{type(error).__name__}: {error}")
        return self._loss
