"""One Modbus connection, TCP or RTU: one request at a time, each with its time limit; a late answer answers nothing.

pymodbus is imported when a link is opened, so that a driver can be read and loaded where it is not installed.
"""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

from arcor2_hw.data.device import Identity
from arcor2_hw.exceptions import ConnectionLost, DeviceFault, DeviceTimeout, NotConnected
from arcor2_hw.objects.settings import check_serial_port

if TYPE_CHECKING:
    from arcor2_hw.objects.modbus_client import Client, ModbusPDU

EXCEPTIONS: Final[Mapping[int, str]] = {
    1: "illegal function",
    2: "illegal address",
    3: "illegal value",
    4: "failure of the device",
    5: "accepted, it will take long",
    6: "the device is busy",
    8: "parity error in its memory",
    10: "the gateway has no path",
    11: "the device behind the gateway does not answer",
}
"""Modbus application protocol 1.1b3, section 7."""


class _NoAnswer(Exception):
    """No valid answer came in time: whether the request was obeyed is not known."""


class ModbusLink:
    """The connection to one device. Requests come from several threads and go out one after the other.

    When no valid answer comes in time the connection is closed and opened again by the next request, so that a late
    answer finds nobody. A serial line carries late answers all the same: there the next request waits for one more
    time-out, which drains the line. When the other end has closed it, requests fail until `open` is called. A reading
    is asked for a second time when no answer came, a write never. A request that is broken off by an exception in its
    thread counts as one that was not answered.

    name: of the device, for errors. host and port for TCP, or serial_port for RTU (`parity` N, E or O).
    request_timeout: s the device has to answer one request. exceptions: what exception codes mean at this device, where
    it differs from EXCEPTIONS. Every method raises NotConnected, ConnectionLost, DeviceTimeout, and DeviceFault with
    the exception code when the device refuses.
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
        self.who = f"{name} at {serial_port or f'{host}:{port}'}"
        self.sent = 0.0
        """When the last request was sent, on the monotonic clock."""
        self._host, self._port, self._unit = host, port, unit_id
        self._serial_port, self._format = serial_port, (baudrate, parity, stopbits)
        self._timeout = request_timeout
        self._exceptions = {**EXCEPTIONS, **exceptions}
        self._one_request = threading.Lock()
        self._client: Client | None = None
        self._usable = False
        self._loss: ConnectionLost | None = None
        self._quiet_until = 0.0

    # -------------------------------------------------------------------------------- life
    def open(self, timeout: float) -> None:
        """Open within `timeout` s; the device is not asked anything. Raises NotConnected, DeviceTimeout."""
        with self._one_request:
            self._close()
            self._open(timeout)
            self._usable, self._loss = True, None

    def close(self) -> None:
        """Close; harmless when closed. A request that waits for its answer on TCP fails at once."""
        self._usable = False
        client = self._client
        if client is not None:
            with contextlib.suppress(OSError):  # the other end was quicker
                client.wake()
        with self._one_request:
            self._close()
            self._loss = None  # what failed just now was our own doing

    @contextlib.contextmanager
    def limited(self, timeout: float) -> Iterator[None]:
        """Give the device at most `timeout` s for each request meanwhile."""
        usual = self._timeout
        self._timeout = min(usual, timeout)
        try:
            yield
        finally:
            self._timeout = usual

    def _open(self, timeout: float) -> None:
        try:
            from arcor2_hw.objects import modbus_client
        except ImportError as error:
            raise NotConnected(
                "{device}: pymodbus is not installed (arcor2-hw[modbus])", str(error), device=self.who
            ) from error
        client: Client
        if self._serial_port:
            client = modbus_client.SerialClient(self._serial_port, *self._format, timeout)
        else:
            client = modbus_client.TcpClient(self._host, self._port, timeout)
        started = time.monotonic()
        if not client.connect():
            if time.monotonic() - started >= timeout:
                raise DeviceTimeout(
                    "{device} did not take the connection within {timeout:.1f} s", device=self.who, timeout=timeout
                )
            why = "the port cannot be opened" if self._serial_port else "nobody takes the connection"
            raise NotConnected("{device} cannot be reached: {reason}", device=self.who, reason=why)
        self._client = client

    def _close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()  # type: ignore[no-untyped-call]

    # -------------------------------------------------------------------------------- reading
    def read_coils(self, address: int, count: int, timeout: float | None = None) -> list[bool]:
        """Read coils (function 1), within `timeout` s (else the link's own) each time it is asked."""
        return self._bits(
            lambda c: c.read_coils(address, count=count, device_id=self._unit), "coils", address, count, timeout
        )

    def read_discrete_inputs(self, address: int, count: int, timeout: float | None = None) -> list[bool]:
        """Read discrete inputs (function 2)."""
        return self._bits(
            lambda c: c.read_discrete_inputs(address, count=count, device_id=self._unit),
            "discrete inputs",
            address,
            count,
            timeout,
        )

    def read_holding_registers(self, address: int, count: int, timeout: float | None = None) -> list[int]:
        """Read holding registers (function 3)."""
        return self._words(
            lambda c: c.read_holding_registers(address, count=count, device_id=self._unit),
            "holding registers",
            address,
            count,
            timeout,
        )

    def read_input_registers(self, address: int, count: int, timeout: float | None = None) -> list[int]:
        """Read input registers (function 4)."""
        return self._words(
            lambda c: c.read_input_registers(address, count=count, device_id=self._unit),
            "input registers",
            address,
            count,
            timeout,
        )

    def identify(self) -> Identity:
        """Read Device Identification (function 43/14), the basic objects."""
        answer = self._read(lambda c: c.read_device_information(read_code=1, device_id=self._unit), "", 0, 0, None)
        told: dict[int, bytes] = getattr(answer, "information", {})
        vendor, product, revision = (bytes(told.get(number, b"")).decode("latin-1") for number in range(3))
        return Identity(vendor=vendor, model=product, firmware=revision)

    # -------------------------------------------------------------------------------- writing
    def write_coil(self, address: int, value: bool, timeout: float | None = None) -> None:
        """Switch a coil (function 5); never sent a second time."""
        self._write(
            lambda c: c.write_coil(address, value, device_id=self._unit),
            f"switching coil {address} {'on' if value else 'off'}",
            timeout,
        )

    def write_coils(self, address: int, values: Sequence[bool], timeout: float | None = None) -> None:
        """Switch coils in one request (function 15); never sent a second time."""
        self._write(
            lambda c: c.write_coils(address, list(values), device_id=self._unit),
            f"switching {_range('coils', address, len(values))}",
            timeout,
        )

    def write_register(self, address: int, value: int, timeout: float | None = None) -> None:
        """Write one holding register (function 6); never sent a second time."""
        self._write(
            lambda c: c.write_register(address, int(value), device_id=self._unit),
            f"a write to register {int(address)}",
            timeout,
        )

    def write_registers(self, address: int, *values: int, timeout: float | None = None) -> None:
        """Write holding registers in one request (function 16); never sent a second time."""
        self._write(
            lambda c: c.write_registers(address, [int(value) for value in values], device_id=self._unit),
            f"a write to register {int(address)}",
            timeout,
        )

    # -------------------------------------------------------------------------------- requests
    def _words(
        self, send: "Callable[[Client], ModbusPDU]", kind: str, address: int, count: int, timeout: float | None
    ) -> list[int]:
        words = self._read(send, kind, address, count, timeout).registers
        if len(words) != count:
            raise DeviceFault(
                "{device} gave {count} of {expected} {type}",
                device=self.who,
                count=len(words),
                expected=count,
                type=kind,
            )
        return list(words)

    def _bits(
        self, send: "Callable[[Client], ModbusPDU]", kind: str, address: int, count: int, timeout: float | None
    ) -> list[bool]:
        bits = self._read(send, kind, address, count, timeout).bits
        if not count <= len(bits) <= count + 7:  # whole bytes come
            raise DeviceFault(
                "{device} gave {count} of {expected} {type}",
                device=self.who,
                count=len(bits),
                expected=count,
                type=kind,
            )
        return list(bits[:count])

    def _read(
        self, send: "Callable[[Client], ModbusPDU]", kind: str, address: int, count: int, timeout: float | None
    ) -> "ModbusPDU":
        """Read; a second time when no answer came, since reading changes nothing."""
        limit = timeout or self._timeout
        what = (kind, address, count)
        try:
            return self._request(send, what, limit)
        except _NoAnswer:
            pass
        try:
            return self._request(send, what, limit)
        except _NoAnswer as error:
            raise DeviceTimeout("{device}: {reason} twice", device=self.who, reason=error) from error.__cause__

    def _write(self, send: "Callable[[Client], ModbusPDU]", what: str, timeout: float | None) -> None:
        try:
            self._request(send, what, timeout or self._timeout)
        except _NoAnswer as error:
            raise DeviceTimeout(
                "{device}: {reason}; it may have been obeyed", device=self.who, reason=error
            ) from error.__cause__

    def _request(
        self, send: "Callable[[Client], ModbusPDU]", what: str | tuple[str, int, int], timeout: float
    ) -> "ModbusPDU":
        with self._one_request:
            if not self._usable:
                raise ConnectionLost(str(self._loss), self._loss.detail) if self._loss else self._not_connected()
            if self._client is None:
                if (drain := self._quiet_until - time.monotonic()) > 0.0:
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
            except BaseException:  # the thread was told to end: nobody waits for the answer any more
                self._give_up()
                raise
        if answer.isError():
            code = int(getattr(answer, "exception_code", 0))
            raise DeviceFault(
                "{device} refuses {what}: {meaning} (exception {code})",
                fault_code=code,
                device=self.who,
                what=_title(what),
                meaning=self._exceptions.get(code, "exception"),
                code=code,
            )
        return answer

    def _failed(
        self, client: "Client", error: Exception, what: str | tuple[str, int, int], timeout: float
    ) -> Exception:
        """Give what a request's failure means; in any case the line is left so that nothing late is taken for new."""
        from arcor2_hw.objects import modbus_client

        if isinstance(error, modbus_client.ConnectionException):
            return self._lost(error)
        if isinstance(error, modbus_client.ModbusException):
            self._give_up()
            told = "what came is no valid answer" if client.received else "no answer came"
            return _NoAnswer(f"{told} within {timeout:.3g} s ({_title(what)})")
        if isinstance(error, OSError | ValueError):  # a reset, or a socket closed by `close`
            return self._lost(error)
        self._give_up()  # decoding foreign bytes may fail in any way
        return _NoAnswer(f"what came is no valid answer ({_title(what)}: {type(error).__name__})")

    def _not_connected(self) -> NotConnected:
        return NotConnected("{device} is not connected", device=self.who)

    def _give_up(self) -> None:
        self._close()
        if self._serial_port:
            self._quiet_until = time.monotonic() + self._timeout

    def _lost(self, error: Exception) -> ConnectionLost:
        self._close()
        self._usable = False
        self._loss = ConnectionLost(
            "{device}: the connection was lost", f"{type(error).__name__}: {error}", device=self.who
        )
        return self._loss


def _range(kind: str, address: int, count: int) -> str:
    return f"{kind} {address} to {address + count - 1}"


def _title(what: str | tuple[str, int, int]) -> str:
    """Give a request's name; made only when something has to be told of it, which a reading seldom has."""
    if isinstance(what, str):
        return what
    return f"reading {_range(*what)}" if what[0] else "reading the identification"
