"""ModbusLink: a connection to a Modbus device over TCP or RTU, with one request at a time.

pymodbus is imported when a link is opened, so that drivers can be loaded without it.
"""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

from arcor2_hw.data.device import Identity
from arcor2_hw.exceptions import ConnectionLost, DeviceFault, DeviceTimeout, NotConnected, Refused
from arcor2_hw.messages import Message, device_at, translatable
from arcor2_hw.objects.modbus_settings import ModbusSettings
from arcor2_hw.objects.settings import check_serial_port

if TYPE_CHECKING:
    from arcor2_hw.objects.modbus_client import Client, ModbusPDU

EXCEPTIONS: Final[Mapping[int, str]] = translatable(
    {
        1: "illegal function",
        2: "illegal address",
        3: "illegal value",
        4: "device failure",
        5: "accepted, takes longer",
        6: "device busy",
        8: "memory parity error",
        10: "gateway path unavailable",
        11: "device behind the gateway does not answer",
    }
)
"""Meanings of exception codes (Modbus application protocol 1.1b3, section 7)."""

_ITEMS: Final = {
    "read_coils": "coils",
    "read_discrete_inputs": "discrete inputs",
    "read_holding_registers": "holding registers",
    "read_input_registers": "input registers",
}
"""Items that are read, by method of the pymodbus client."""


class _NoAnswer(Exception):
    """No valid answer was received in time. It is unknown whether the device executed the request."""


class ModbusLink:
    """The connection to one device. Several threads may send requests; they are executed one after the other.

    If no valid answer is received in time, the connection is closed, and the next request opens it again, so that a
    late answer is not mistaken for that of another request. On a serial line the next request also waits for one more
    timeout, until a late answer has arrived. After the other end has closed the connection, requests fail until `open`
    is called. Reads without an answer are repeated once, writes never. A request interrupted by an exception in its
    thread counts as not answered.

    Args:
        name: Name of the device, for errors.
        host: Host name or address, for TCP.
        port: TCP port.
        unit_id: Unit id of the device.
        request_timeout: Time in which the device has to answer a request, s.
        serial_port: Path of the serial port, for RTU.
        baudrate: Bits per second of the serial port.
        parity: N, E or O.
        stopbits: Number of stop bits.
        exceptions: Meanings of exception codes that differ from EXCEPTIONS.

    Raises:
        NotConnected: The device cannot be reached, or the link is closed.
        ConnectionLost: The connection was lost.
        DeviceTimeout: The device did not answer in time.
        DeviceFault: The device refused the request; `fault_code` is the exception code.
    """

    def __init__(
        self,
        name: str,
        host: str = "",
        port: int = 502,
        unit_id: int = 1,
        request_timeout: float = 0.5,
        *,
        serial_port: str = "",
        baudrate: int = 19200,
        parity: str = "N",
        stopbits: int = 1,
        exceptions: Mapping[int, str] = EXCEPTIONS,
    ) -> None:
        if serial_port:
            check_serial_port("serial_port", serial_port)
        self.who: str | Message = device_at(name, serial_port or f"{host}:{port}")
        self.sent = 0.0
        """Time at which the last request was sent (monotonic, s)."""
        self._host, self._port, self._unit = host, port, unit_id
        self._serial_port, self._format = serial_port, (baudrate, parity, stopbits)
        self._timeout = request_timeout
        self._exceptions = {**EXCEPTIONS, **exceptions}
        self._one_request = threading.Lock()
        self._client: Client | None = None
        self._usable = False
        self._loss: ConnectionLost | None = None
        self._drained_at = 0.0

    @classmethod
    def of(cls, name: str, settings: ModbusSettings, *, exceptions: Mapping[int, str] = EXCEPTIONS) -> "ModbusLink":
        """Return the link to a device with these settings."""
        return cls(
            name,
            settings.host,
            settings.port,
            settings.unit_id,
            settings.request_timeout,
            serial_port=settings.serial_port,
            baudrate=settings.baudrate,
            parity=settings.parity[0].upper(),
            stopbits=settings.stopbits,
            exceptions=exceptions,
        )

    # -------------------------------------------------------------------------------- life
    def load(self) -> None:
        """Import pymodbus, which takes seconds on a busy computer. Raises NotConnected if it is not installed."""
        try:
            import arcor2_hw.objects.modbus_client  # noqa: F401
        except ImportError as error:
            raise NotConnected(
                "{device}: pymodbus is not installed. Install arcor2-hw[modbus].", str(error), device=self.who
            ) from error

    def open(self, timeout: float) -> None:
        """Open the connection within `timeout` s without sending a request. Raises NotConnected, DeviceTimeout."""
        self.load()
        with self._one_request:
            self._close()
            self._open(timeout)
            self._usable, self._loss = True, None

    def close(self) -> None:
        """Close the connection. It does nothing when closed. A request that waits for its answer fails at once."""
        self._usable = False
        client = self._client
        if client is not None:
            with contextlib.suppress(OSError):  # the other end has closed it already
                client.wake()
        with self._one_request:
            self._close()
            self._loss = None  # the request in progress failed because of this call

    @contextlib.contextmanager
    def limited(self, timeout: float) -> Iterator[None]:
        """Limit the time of each request to `timeout` s in this context."""
        usual = self._timeout
        self._timeout = min(usual, timeout)
        try:
            yield
        finally:
            self._timeout = usual

    def _open(self, timeout: float) -> None:
        from arcor2_hw.objects import modbus_client

        client: Client
        if self._serial_port:
            client = modbus_client.SerialClient(self._serial_port, *self._format, timeout)
        else:
            client = modbus_client.TcpClient(self._host, self._port, timeout)
        started = time.monotonic()
        if not client.connect():
            if time.monotonic() - started >= timeout:
                raise DeviceTimeout(
                    "{device} did not accept the connection within {timeout:.1f} s", device=self.who, timeout=timeout
                )
            raise NotConnected(
                "{device} cannot be reached: the port cannot be opened"
                if self._serial_port
                else "{device} cannot be reached: connection refused. Is the device switched on?",
                device=self.who,
            )
        self._client = client

    def _close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()  # type: ignore[no-untyped-call]

    # -------------------------------------------------------------------------------- reading
    def read_coils(self, address: int, count: int, timeout: float | None = None) -> list[bool]:
        """Read coils (function 1). `timeout`: time limit of each attempt, s, by default that of the link."""
        return self._bits("read_coils", address, count, timeout)

    def read_discrete_inputs(self, address: int, count: int, timeout: float | None = None) -> list[bool]:
        """Read discrete inputs (function 2)."""
        return self._bits("read_discrete_inputs", address, count, timeout)

    def read_holding_registers(self, address: int, count: int, timeout: float | None = None) -> list[int]:
        """Read holding registers (function 3)."""
        return self._words("read_holding_registers", address, count, timeout)

    def read_input_registers(self, address: int, count: int, timeout: float | None = None) -> list[int]:
        """Read input registers (function 4)."""
        return self._words("read_input_registers", address, count, timeout)

    def identify(self) -> Identity:
        """Read Device Identification (function 43/14), the basic objects."""
        answer = self._read(
            lambda c: c.read_device_information(read_code=1, device_id=self._unit), "reading the identification", None
        )
        objects: dict[int, bytes] = getattr(answer, "information", {})
        vendor, product, revision = (bytes(objects.get(number, b"")).decode("latin-1") for number in range(3))
        return Identity(vendor=vendor, model=product, firmware=revision)

    # -------------------------------------------------------------------------------- writing
    def write_coil(self, address: int, value: bool, timeout: float | None = None) -> None:
        """Switch a coil (function 5); never repeated."""
        self._write(
            lambda c: c.write_coil(address, value, device_id=self._unit),
            f"switching coil {address} {'on' if value else 'off'}",
            timeout,
        )

    def write_coils(self, address: int, values: Sequence[bool], timeout: float | None = None) -> None:
        """Switch coils in one request (function 15); never repeated."""
        self._write(
            lambda c: c.write_coils(address, list(values), device_id=self._unit),
            f"switching coils {address} to {address + len(values) - 1}",
            timeout,
        )

    def write_register(self, address: int, value: int, timeout: float | None = None) -> None:
        """Write one holding register (function 6); never repeated."""
        self._write(
            lambda c: c.write_register(address, int(value), device_id=self._unit),
            f"a write to register {int(address)}",
            timeout,
        )

    def write_registers(self, address: int, *values: int, timeout: float | None = None) -> None:
        """Write holding registers in one request (function 16); never repeated."""
        self._write(
            lambda c: c.write_registers(address, [int(value) for value in values], device_id=self._unit),
            f"a write to register {int(address)}",
            timeout,
        )

    def write_verified(self, address: int, *values: int) -> None:
        """Write holding registers and read them back. Raises Refused if the device did not accept the values."""
        self.write_registers(address, *values)
        if (stored := self.read_holding_registers(address, len(values))) != [*values]:
            raise Refused(
                "{device}: registers from {address} contain {stored} after {values} was written",
                device=self.who,
                address=int(address),
                stored=stored,
                values=[*map(int, values)],
            )

    # -------------------------------------------------------------------------------- requests
    def _words(self, method: str, address: int, count: int, timeout: float | None) -> list[int]:
        words = self._read_items(method, address, count, timeout).registers
        if len(words) != count:
            raise DeviceFault(
                "{device} sent {count} of {expected} {items}",
                device=self.who,
                count=len(words),
                expected=count,
                items=_ITEMS[method],
            )
        return list(words)

    def _bits(self, method: str, address: int, count: int, timeout: float | None) -> list[bool]:
        bits = self._read_items(method, address, count, timeout).bits
        if not count <= len(bits) <= count + 7:  # whole bytes are sent
            raise DeviceFault(
                "{device} sent {count} of {expected} {items}",
                device=self.who,
                count=len(bits),
                expected=count,
                items=_ITEMS[method],
            )
        return list(bits[:count])

    def _read_items(self, method: str, address: int, count: int, timeout: float | None) -> "ModbusPDU":
        what = f"reading {_ITEMS[method]} {address} to {address + count - 1}"
        return self._read(lambda c: getattr(c, method)(address, count=count, device_id=self._unit), what, timeout)

    def _read(self, send: "Callable[[Client], ModbusPDU]", what: str, timeout: float | None) -> "ModbusPDU":
        """Send a read request, and send it again if there is no answer."""
        limit = timeout or self._timeout
        with contextlib.suppress(_NoAnswer):
            return self._request(send, what, limit)
        try:
            return self._request(send, what, limit)
        except _NoAnswer as error:
            raise DeviceTimeout("{device}: {reason} twice", device=self.who, reason=error) from error.__cause__

    def _write(self, send: "Callable[[Client], ModbusPDU]", what: str, timeout: float | None) -> None:
        try:
            self._request(send, what, timeout or self._timeout)
        except _NoAnswer as error:
            raise DeviceTimeout(
                "{device}: {reason}; it may have been executed", device=self.who, reason=error
            ) from error.__cause__

    def _request(self, send: "Callable[[Client], ModbusPDU]", what: str, timeout: float) -> "ModbusPDU":
        with self._one_request:
            if not self._usable:
                raise ConnectionLost(self._loss.message, self._loss.detail) if self._loss else self._not_connected()
            if self._client is None:
                if (drain := self._drained_at - time.monotonic()) > 0.0:
                    time.sleep(drain)
                self._open(timeout)
            client = self._client
            assert client is not None
            client.received = False
            self.sent = time.monotonic()
            client.deadline = self.sent + timeout
            try:
                answer = send(client)
            except Exception as error:
                raise self._failed(client, error, what, timeout) from error
            except BaseException:  # the thread is ending and no longer waits for the answer
                self._give_up()
                raise
        if answer.isError():
            code = int(getattr(answer, "exception_code", 0))
            raise DeviceFault(
                "{device} refused {what}: {meaning} (exception {code})",
                fault_code=code,
                device=self.who,
                what=what,
                meaning=Message.of(self._exceptions.get(code, translatable("exception"))),
                code=code,
            )
        return answer

    def _failed(self, client: "Client", error: Exception, what: str, timeout: float) -> Exception:
        """Close the connection after a failed request, so that its late answer is discarded, and return the error."""
        from arcor2_hw.objects import modbus_client

        if isinstance(error, modbus_client.ConnectionException):
            return self._lost(error)
        if isinstance(error, modbus_client.ModbusException):
            self._give_up()
            problem = "no valid answer" if client.received else "no answer"
            return _NoAnswer(f"{problem} within {timeout:.3g} s ({what})")
        if isinstance(error, OSError | ValueError):  # a reset, or a socket closed by `close`
            return self._lost(error)
        self._give_up()  # decoding an invalid answer may raise any exception
        return _NoAnswer(f"no valid answer ({what}: {type(error).__name__})")

    def _not_connected(self) -> NotConnected:
        return NotConnected("{device} is not connected", device=self.who)

    def _give_up(self) -> None:
        self._close()
        if self._serial_port:
            self._drained_at = time.monotonic() + self._timeout

    def _lost(self, error: Exception) -> ConnectionLost:
        self._close()
        self._usable = False
        self._loss = ConnectionLost(
            "{device}: the connection was lost", f"{type(error).__name__}: {error}", device=self.who
        )
        return self._loss
