"""Fakes of devices with a few registers: their process, wire (Modbus, text line, HTTP), faults and truth.

The fake of a new device derives from `Device` and is run by `serve_device`. Another kind of device is a class with
`words`, `write` and `heard`, run by `serve`. Another text or HTTP protocol is another function `answer`.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from arcor2_fakes.serial_line import Line, PtyLine, TcpLine
from arcor2_fakes.serving import Fake, Wire, address_of
from arcor2_fakes.serving import serve as run_fake
from arcor2_fakes.wire import Connection, TcpWire

READ_INPUT, WRITE_ONE, WRITE_SEVERAL = 4, 6, 16
MAX_LINE = 4096
Answer = Callable[["Registers", bytes], bytes]
"""Returns the answer to a request; both are lines without their end, or HTTP messages."""


class Refusal(Exception):
    """The device refuses a write in its present state."""


class Registers(Protocol):
    """A device: registers that are read, registers that are written."""

    written: list[list[int]]
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
        self.written: list[list[int]] = []
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
        self.words()  # a watchdog that expired before this request stays expired
        self.spoke = time.monotonic()

    def words(self) -> list[int]:
        """Return the registers that are read."""
        now = time.monotonic()
        self.advance(now)
        if self.owner == HOST and now - self.spoke > self.watchdog:
            self.owner = NOBODY
            self.let_go()
        return [getattr(self, name) for name in self.names]

    def write(self, address: int, values: list[int]) -> None:
        """Execute a write of the host. Raise Refusal."""
        if self.owner == PANEL:
            raise Refusal("the panel has control")
        self.written.append([address, *values])
        if address == WATCHDOG:
            self.watchdog, self.owner = values[0] / 1000, HOST if values[0] else NOBODY
            if not values[0]:
                self.let_go()
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
        return dict(zip(self.names, self.words(), strict=True)) | {"busy": self.busy}


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
    status, content = "404 Not Found", json.dumps({"error": "no such path"})
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


def line_length(buffer: bytes) -> int | None:
    """Return the length of the first line in a buffer, with its CR; None while it is incomplete."""
    end = buffer.find(b"\r")
    return None if end < 0 else end + 1


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
            request = bytes(buffer[:taken]).strip(b"\r\n") if end else bytes(buffer[:taken])
            del buffer[:taken]
            device.heard()
            send(answer(device, request) + end)

    return received


def modbus_wire(device: Registers, host: str, port: int) -> TcpWire:
    """Return a Modbus TCP port: `words` are its input registers, `write` executes writes of holding registers."""
    from pymodbus.constants import ExcCodes
    from pymodbus.server import ModbusTcpServer
    from pymodbus.simulator import DataType, SimData, SimDevice

    from arcor2_fakes.modbus import tcp_wire

    size = len(device.words())

    async def access(
        function: int,
        start: int,  # noqa: ARG001
        address: int,
        count: int,  # noqa: ARG001
        registers: list[int],
        values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        device.heard()
        if function in (WRITE_ONE, WRITE_SEVERAL) and values is not None:
            try:
                device.write(address, [int(value) for value in values])
            except Refusal:
                return ExcCodes.DEVICE_BUSY
        elif function == READ_INPUT:
            registers[:size] = device.words()
        return None

    bits = [SimData(0, values=[False], datatype=DataType.BITS)]
    holding = [SimData(0, values=[0] * 64, datatype=DataType.REGISTERS)]
    inputs = [SimData(0, values=[0] * size, datatype=DataType.REGISTERS)]
    server = ModbusTcpServer(SimDevice(1, simdata=(bits, bits, holding, inputs), action=access))

    return tcp_wire(server, host, port, "wire")


def http_wire(device: Registers, answer: Answer, host: str, port: int) -> TcpWire:
    """Return an HTTP port."""

    def opened(connection: Connection) -> None:
        connection.received = cut(device, answer, http_length, connection.send, b"")

    return TcpWire("wire", host, port, opened)


def text_line(device: Registers, answer: Answer, host: str, port: int, link: Path | None) -> Line:
    """Return a text line: a pty with a symbolic link, or without `link` a TCP port."""
    received = cut(device, answer, line_length, lambda frame: line.send(frame), b"\r")
    line: Line = TcpLine(received, host, port) if link is None else PtyLine(received, link)
    return line


def serve(
    name: str,
    make: Callable[[], Registers],
    truth: Callable[[Any], dict[str, Any]],
    bus: str,
    commands: Callable[[Any], dict[str, Callable[..., Any]]] = lambda _: {},
    answer: Answer | None = None,
) -> int:
    """Run the fake of a device until the end of the process; return the exit status.

    Args:
        name: Name of the device.
        make: Returns the device.
        truth: Returns the true state of the device, for tests.
        bus: modbus, serial, tcp or http.
        commands: Returns the commands of the control channel by name.
        answer: Codec of another text or HTTP protocol.
    """
    parser = argparse.ArgumentParser(prog=name, description=f"Fake {name} on {bus}.")
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=0, help="0 takes a free one")
    parser.add_argument("--control", default="127.0.0.1:0", help="HOST:PORT of the control channel")
    options = parser.parse_args()

    async def body(fake: Fake) -> None:
        device = make()
        wire: Wire
        if bus == "modbus":
            wire = modbus_wire(device, options.host, options.port)
        elif bus == "http":
            wire = http_wire(device, answer or answer_http, options.host, options.port)
        else:
            folder = tempfile.TemporaryDirectory(prefix="arcor2-fake-")
            fake.at_end(folder.cleanup)
            link = Path(folder.name) / f"tty-{name}" if bus == "serial" else None
            wire = text_line(device, answer or answer_line, options.host, options.port, link)
        fake.wires(wire=wire)
        fake.truth(lambda: truth(device) | {"written": device.written})
        fake.commands(**commands(device))
        await fake.run(address=lambda: address_of(wire).removeprefix("socket://"))

    return run_fake(name, options.control, body)


def serve_device(name: str, make: Callable[[], Device], bus: str, *commands: str) -> int:
    """Run the fake of a `Device` until the end of the process; return the exit status.

    Args:
        name: Name of the device.
        make: Returns the device.
        bus: modbus, serial, tcp or http.
        commands: Names of the methods that the control channel may call, besides `panel` and `rest`.
    """
    return serve(
        name,
        make,
        lambda device: device.truth(),
        bus,
        lambda device: {command: getattr(device, command) for command in ("panel", "rest", *commands)},
    )
