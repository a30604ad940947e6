"""Fakes of devices with a few registers: their process, wire (Modbus, text line, HTTP), faults and truth.

The fake of a new device derives from `Device`, or from `MappedDevice` if it has a register map of its own, and is run
by `serve_device`. Another kind of device is a class with `words`, `write` and `heard`, run by `serve`. Another text or
HTTP protocol is another function `answer`.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, Protocol

from arcor2_fakes.modbus import ExceptionCode, ModbusRefusal, ModbusTables, serial_line, tcp_wire
from arcor2_fakes.register_map import MapTables, Place, Refusal, RegisterMap
from arcor2_fakes.serial_line import Line, PtyLine, TcpLine
from arcor2_fakes.serving import Fake, Wire, address_of, serve as run_fake
from arcor2_fakes.wire import Connection, TcpWire

__all__ = ["Device", "MappedDevice", "Refusal", "Registers", "serve", "serve_device"]

MAX_LINE = 4096
Answer = Callable[["Registers", bytes], bytes]
"""Returns the answer to a request; both are lines without their end, or HTTP messages."""


class Registers(Protocol):
    """A device: registers that are read, registers that are written."""

    written: list[list[Any]]
    """All writes: address, then values."""

    def words(self) -> list[int]:
        """Return the present values of the registers that are read, 16 bits each."""
        ...

    def write(self, address: int, values: list[int]) -> None:
        """Execute a write. Raise Refusal."""
        ...

    def heard(self) -> None:
        """Note a request of the host."""
        ...


NOBODY, HOST, PANEL = 0, 1, 2
"""Values of the register `owner`."""
COMMAND, WATCHDOG = 0, 2
"""Registers that are written: a command with its arguments; the time without a request after which it stops, ms."""


class Device:
    """A device of the driver templates: a command register, a watchdog on the host, and an operator panel.

    A subclass overrides `command` and, where it needs them, `power_on`, `advance` and `let_go`.
    """

    names: tuple[str, ...] = ("state", "value", "count", "fault", "owner")
    """Registers that are read, in order; each is an attribute."""

    def __init__(self) -> None:
        self.written: list[list[Any]] = []
        self.state = self.fault = 0
        self.__dict__ |= dict.fromkeys(self.names, 0)
        self.owner, self.watchdog = NOBODY, 0.0
        self.began = self.spoke = time.monotonic()
        self.power_on()

    def power_on(self) -> None:
        """Initialize the state that is not in registers."""

    def advance(self, now: float) -> None:
        """Advance the simulation to a time (monotonic, s)."""

    def command(self, number: int, *values: int) -> None:
        """Execute a command. Raise Refusal."""
        raise NotImplementedError

    def let_go(self) -> None:
        """Stop: the host has released control, or its watchdog has expired."""
        self.state = 0

    @property
    def busy(self) -> bool:
        """Return whether the device is working."""
        return self.state == 1

    def heard(self) -> None:
        """Note a request of the host."""
        self.update()  # a watchdog that expired before this request stays expired
        self.spoke = time.monotonic()

    def update(self) -> None:
        """Advance the simulation to the present, and let the watchdog expire."""
        now = time.monotonic()
        self.advance(now)
        if self.owner == HOST and now - self.spoke > self.watchdog:
            self.guard(0.0)

    def guard(self, seconds: float) -> None:
        """Give control to the host until it is silent for `seconds`; 0 takes control away and stops."""
        self.watchdog, self.owner = seconds, HOST if seconds else NOBODY
        if not seconds:
            self.let_go()

    def words(self) -> list[int]:
        """Return the registers that are read."""
        self.update()
        return [getattr(self, name) for name in self.names]

    def write(self, address: int, values: list[int]) -> None:
        """Execute a write of the host. Raise Refusal."""
        if self.owner == PANEL:
            raise Refusal("the panel has control")
        self.written.append([address, *values])
        if address == WATCHDOG:
            self.guard(values[0] / 1000)
        elif self.owner != HOST or address != COMMAND:
            raise Refusal("nobody has control")
        else:
            self.command(*values)

    def rest(self) -> None:
        """Reset to the state after power on, for tests that share a process."""
        self.__init__()  # type: ignore[misc]

    def panel(self, on: bool) -> None:
        """Take or release control at the operator panel."""
        self.owner = PANEL if on else NOBODY

    def truth(self) -> dict[str, Any]:
        """Return the real state, for tests."""
        self.update()
        return {name: getattr(self, name) for name in self.names} | {"busy": self.busy}


class MappedDevice(Device):
    """A device with a register map of its own: `places` says where each value in `registers` is.

    A value is a number, or a bool for a coil, a discrete input or a bit; at first 0. A place named `owner` shows
    who has control (NOBODY, HOST, PANEL). A write sets values and then calls `changed` for each. Addresses that are not
    in the map do not exist. A subclass overrides `changed` and, where it needs them, `busy` and the hooks of `Device`.
    """

    names = ()
    places: ClassVar[Mapping[str, Place]]
    unrecorded: ClassVar[tuple[str, ...]] = ()
    """Places whose writes are not in `written`, such as a heartbeat."""

    def __init__(self) -> None:
        self.map = RegisterMap(self.places)
        self.registers = SimpleNamespace(**dict.fromkeys(self.places, 0))
        super().__init__()

    def changed(self, name: str, value: Any) -> None:
        """Handle that the host wrote a value. Raise Refusal to undo the write."""

    def update(self) -> None:
        """Advance the simulation to the present."""
        super().update()
        if "owner" in self.places:
            self.registers.owner = self.owner

    def write_map(self, table: str, address: int, words: Sequence[int]) -> None:
        """Execute a write of the host. Raises Refusal, LookupError."""
        before = vars(self.registers).copy()
        written = self.map.write(before, table, address, words)
        if self.owner == PANEL:
            raise Refusal("the panel has control")
        vars(self.registers).update(written)
        try:
            for name, value in written.items():
                self.changed(name, value)
        except Refusal:
            vars(self.registers).update(before)
            raise
        self.written.extend([name, value] for name, value in written.items() if name not in self.unrecorded)

    def truth(self) -> dict[str, Any]:
        """Return the real state, for tests."""
        return super().truth() | {"registers": vars(self.registers)}


def answer_line(device: Registers, line: bytes) -> bytes:
    """Answer the text protocol of the template: `R first count` with `= words`, `W first words` with OK or ERR."""
    try:
        verb, first, *rest = line.decode("ascii").split()
        numbers = [int(part) for part in rest]
        if verb == "R" and len(numbers) == 1:
            words = device.words()[int(first) : int(first) + numbers[0]]
            return " ".join(["=", *map(str, words)]).encode()
        if verb == "W" and numbers:
            device.write(int(first), numbers)
            return b"OK"
    except (ValueError, UnicodeDecodeError):
        return b"ERR syntax"
    except Refusal as e:
        return f"ERR {e}".encode()
    return b"ERR syntax"


def answer_http(device: Registers, request: bytes) -> bytes:
    """Answer the HTTP API of the template: `GET /registers` and `PUT /registers/FIRST`, each with a list of words."""
    head, _, body = request.partition(b"\r\n\r\n")
    method, path, *_ = head.split(b"\r\n", 1)[0].decode("latin-1").split(" ")
    status, content = "404 Not Found", json.dumps({"error": "this path does not exist"})
    if (method, path) == ("GET", "/registers"):
        status, content = "200 OK", json.dumps(device.words())
    elif method == "PUT" and path.startswith("/registers/"):
        try:
            device.write(int(path.rpartition("/")[2]), [int(value) for value in json.loads(body)])
            status, content = "200 OK", "{}"
        except Refusal as e:
            status, content = "409 Conflict", json.dumps({"error": str(e)})
        except (ValueError, TypeError):
            status, content = "400 Bad Request", json.dumps({"error": "not a list of words"})
    return (
        f"HTTP/1.1 {status}\r\nContent-Type: application/json\r\nContent-Length: {len(content)}\r\n\r\n{content}"
    ).encode()


def http_length(buffer: bytes) -> int | None:
    """Return the length of the first HTTP request in a buffer, None while it is incomplete."""
    end = buffer.find(b"\r\n\r\n")
    if end < 0:
        return None
    lengths = [
        int(line.split(b":")[1]) for line in buffer[:end].split(b"\r\n") if line.lower().startswith(b"content-length:")
    ]
    whole = end + 4 + (lengths[0] if lengths else 0)
    return whole if len(buffer) >= whole else None


def cut(
    device: Registers, answer: Answer, length: Callable[[bytes], int | None], send: Callable[[bytes], Any], end: bytes
) -> Callable[[bytes], None]:
    """Return a function that receives bytes and answers each complete request."""
    buffer = bytearray()

    def received(data: bytes) -> None:
        buffer.extend(data)
        if len(buffer) > MAX_LINE:
            buffer.clear()  # no valid request is that long
        while (taken := length(bytes(buffer))) is not None:
            request = bytes(buffer[:taken]).removesuffix(end).strip(b"\r\n") if end else bytes(buffer[:taken])
            del buffer[:taken]
            device.heard()
            send(answer(device, request) + end)

    return received


class _Tables(ModbusTables):
    """Tables of a device without a map: `words` are input registers, `write` writes holding registers."""

    holding_registers = 64

    def __init__(self, device: Registers) -> None:
        self._device = device
        self.input_registers = len(device.words())  # type: ignore[misc] # of this device

    def request_arrived(self) -> None:
        self._device.heard()

    def read_input_registers(self) -> list[int]:
        return self._device.words()

    def write_holding_registers(self, address: int, values: list[int]) -> None:
        try:
            self._device.write(address, values)
        except Refusal:
            raise ModbusRefusal(ExceptionCode.DEVICE_BUSY) from None


def http_wire(device: Registers, answer: Answer, host: str, port: int) -> TcpWire:
    """Return an HTTP port."""

    def opened(connection: Connection) -> None:
        connection.received = cut(device, answer, http_length, connection.send, b"")

    return TcpWire("wire", host, port, opened)


def text_line(device: Registers, answer: Answer, host: str, port: int, link: Path | None, end: bytes = b"\r") -> Line:
    """Return a text line: a pty with a symbolic link, or without `link` a TCP port."""

    def line_length(buffer: bytes) -> int | None:
        place = buffer.find(end)
        return None if place < 0 else place + len(end)

    received = cut(device, answer, line_length, lambda frame: line.send(frame), end)
    line: Line = TcpLine(received, host, port) if link is None else PtyLine(received, link)
    return line


def serve(
    name: str,
    make: Callable[[], Registers],
    truth: Callable[[Any], dict[str, Any]],
    bus: str,
    commands: Callable[[Any], dict[str, Callable[..., Any]]] = lambda _: {},
    answer: Answer | None = None,
    end: bytes = b"\r",
) -> int:
    """Run the fake of a device until the end of the process; return the exit status.

    Args:
        name: Name of the device.
        make: Returns the device.
        truth: Returns the true state of the device, for tests.
        bus: modbus, serial, tcp or http.
        commands: Returns the commands of the control channel by name.
        answer: Codec of another text or HTTP protocol.
        end: End of a line, of requests and answers, on serial and tcp.
    """
    parser = argparse.ArgumentParser(prog=name, description=f"Fake {name} on {bus}.")
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=0, help="0 takes a free one")
    if bus == "modbus":
        parser.add_argument("--rtu", action="store_true", help="Modbus RTU on a pseudo terminal in place of TCP")
    parser.add_argument("--control", default="127.0.0.1:0", help="HOST:PORT of the control channel")
    options = parser.parse_args()

    async def body(fake: Fake) -> None:
        device = make()
        folder = tempfile.TemporaryDirectory(prefix="arcor2-fake-")
        fake.at_end(folder.cleanup)
        port = Path(folder.name) / f"tty-{name}"
        rtu = bus == "modbus" and options.rtu
        wire: Wire
        if bus == "modbus":
            tables = MapTables(device) if isinstance(device, MappedDevice) else _Tables(device)
            wire = serial_line(tables, port) if rtu else tcp_wire(tables, options.host, options.port)
        elif bus == "http":
            wire = http_wire(device, answer or answer_http, options.host, options.port)
        else:
            link = port if bus == "serial" else None
            wire = text_line(device, answer or answer_line, options.host, options.port, link, end)
        fake.wires(("wire",) if rtu else (), wire=wire)
        fake.truth(lambda: truth(device) | {"written": device.written})
        fake.commands(**commands(device))
        await fake.run(address=lambda: address_of(wire).removeprefix("socket://"))

    return run_fake(name, options.control, body)


def serve_device(name: str, make: Callable[[], Device], bus: str, *commands: str, end: bytes = b"\r") -> int:
    """Run the fake of a `Device` until the end of the process; return the exit status.

    Args:
        name: Name of the device.
        make: Returns the device.
        bus: modbus, serial, tcp or http.
        commands: Names of the methods that the control channel may call, besides `panel` and `rest`.
        end: End of a line, on serial and tcp.
    """
    return serve(
        name,
        make,
        lambda device: device.truth(),
        bus,
        lambda device: {command: getattr(device, command) for command in ("panel", "rest", *commands)},
        end=end,
    )
