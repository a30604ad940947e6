"""The RTDE port: set-up of recipes, the periodic data packages, and input packages into registers and I/O."""

import logging
import struct
from collections.abc import Callable
from typing import Any

from arcor2_fakes.ur.controller import Controller
from arcor2_fakes.ur.outputs import Reader, apply_inputs, readers
from arcor2_fakes.ur.rtde import FORMATS, HEADER, INPUTS, OUTPUTS, Deframer, FramingError, Kind, pack, split_names
from arcor2_fakes.wire import Connection

log = logging.getLogger("rtde")

PROTOCOL_VERSION = 2
STOP_COMMANDS = {15: "speedStop", 16: "servoStop", 33: "stopL", 34: "stopJ", 255: "stopScript"}


def _zeros(count: int) -> Reader:
    values = (0,) * count
    return lambda: values


class OutputRecipe:
    """One data package, packed into the same buffer in each cycle."""

    def __init__(self, number: int, names: list[str], sources: dict[str, Reader], every: float) -> None:
        offset = HEADER.size + 1
        self._fields: list[tuple[Callable[..., None], int, Reader]] = []
        for name in names:
            field = struct.Struct(">" + FORMATS[OUTPUTS[name]])
            # A variable that is not modelled is zero, like one without hardware on a controller.
            read = sources.get(name) or _zeros(len(field.unpack(bytes(field.size))))
            self._fields.append((field.pack_into, offset, read))
            offset += field.size
        self._buffer = bytearray(offset)
        HEADER.pack_into(self._buffer, 0, offset, Kind.DATA)
        self._buffer[HEADER.size] = number
        self._every = every
        self._left = 1.0

    def due(self) -> bool:
        """Count one control cycle; return whether a package is due."""
        self._left -= 1.0
        if self._left > 1e-9:
            return False
        self._left += self._every
        return True

    def frame(self) -> bytes:
        """Return the package of this cycle."""
        buffer = self._buffer
        for pack_into, offset, read in self._fields:
            pack_into(buffer, offset, *read())
        return bytes(buffer)


class InputRecipe:
    """Destination of the values of an input package."""

    def __init__(self, names: list[str], controller: Controller) -> None:
        self.names = names
        self._format = struct.Struct(">" + "".join(FORMATS[INPUTS[name]] for name in names))
        self._spans: list[tuple[int, list[Any], int]] = []  # position of the value, registers, index there
        self._position: dict[str, int] = {}
        position = 0
        for name in names:
            kind, _, index = name.rpartition("_register_")
            if kind == "input_int":
                self._spans.append((position, controller.input_ints, int(index)))
            elif kind == "input_double":
                self._spans.append((position, controller.input_doubles, int(index)))
            else:
                self._position[name] = position
            position += 6 if INPUTS[name] == "VECTOR6D" else 1
        self._controller = controller

    def apply(self, payload: bytes) -> bool:
        """Apply a package; bytes beyond the recipe are ignored. Return False if it is too short."""
        if len(payload) - 1 < self._format.size:
            return False
        values = self._format.unpack_from(payload, 1)
        c = self._controller
        for position, registers, index in self._spans:
            registers[index] = values[position]
            if registers is c.input_ints:
                c.integer_written(index)
                if values[position] in STOP_COMMANDS and c.program is not None and c.program.register_offset == index:
                    c.note_stop("rtde", values[position])
        if self._position:
            apply_inputs(c, {name: values[position] for name, position in self._position.items()})
        return True


class RtdeServer:
    """All clients of the RTDE port."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.sources = readers(controller)
        self.claims: dict[str, object] = {}
        """Writer of each input variable; there is only one."""
        self.not_found: set[str] = set()
        self.sessions: set[Session] = set()
        self.samples_sent = 0
        self.samples_lost = 0

    def opened(self, connection: Connection) -> None:
        """Serve a client."""
        self.sessions.add(Session(self, connection))

    def tick(self) -> None:
        """Send this cycle's packages."""
        for session in self.sessions:
            if session.recipe is not None and session.recipe.due():
                if session.connection.send(session.recipe.frame()):
                    self.samples_sent += 1
                else:
                    self.samples_lost += 1


class Session:
    """One client of the RTDE port."""

    def __init__(self, server: RtdeServer, connection: Connection) -> None:
        self.connection = connection
        self.recipe: OutputRecipe | None = None  # while started
        self._server = server
        self._outputs: OutputRecipe | None = None
        self._inputs: list[InputRecipe] = []
        self._deframer = Deframer()
        connection.received = self._received
        connection.closed = self._closed

    def _closed(self) -> None:
        self._server.sessions.discard(self)
        for name in [name for name, owner in self._server.claims.items() if owner is self]:
            del self._server.claims[name]

    def _received(self, data: bytes) -> None:
        try:
            for kind, payload in self._deframer.feed(data):
                self._handle(kind, payload)
        except (FramingError, struct.error) as e:
            log.info("client dropped: %s", e)
            self.connection.close()

    def _handle(self, kind: int, payload: bytes) -> None:
        if kind == Kind.DATA:
            self._data(payload)
        elif kind == Kind.SETUP_INPUTS:
            self._answer(kind, self._set_up_inputs(split_names(payload)))
        elif kind == Kind.SETUP_OUTPUTS:
            (frequency,) = struct.unpack_from(">d", payload)
            self._answer(kind, self._set_up_outputs(frequency, split_names(payload[8:])))
        elif kind == Kind.START:
            # The answer must be first, because a client interprets the next package as the answer.
            self._answer(kind, bytes((self._outputs is not None,)))
            self.recipe = self._outputs
        elif kind == Kind.PAUSE:
            self.recipe = None
            self._answer(kind, b"\x01")
        elif kind == Kind.REQUEST_PROTOCOL_VERSION:
            self._answer(kind, bytes((struct.unpack_from(">H", payload)[0] == PROTOCOL_VERSION,)))
        elif kind == Kind.GET_CONTROLLER_VERSION:
            version = (*self._server.controller.version, 0, 0, 0, 0)[:4]
            self._answer(kind, struct.pack(">4I", *version))
        elif kind != Kind.TEXT_MESSAGE:
            log.info("unknown frame type %d", kind)

    def _answer(self, kind: int, payload: bytes) -> None:
        self.connection.send(pack(kind, payload))

    def _set_up_outputs(self, frequency: float, names: list[str]) -> bytes:
        server = self._server
        known = [name in OUTPUTS and name not in server.not_found for name in names]
        types = ",".join(OUTPUTS[name] if ok else "NOT_FOUND" for name, ok in zip(names, known, strict=True))
        rate = server.controller.frequency
        good = all(known) and 1.0 <= frequency <= rate
        self._outputs = OutputRecipe(1, names, server.sources, rate / frequency) if good else None
        return bytes((int(good),)) + types.encode()

    def _set_up_inputs(self, names: list[str]) -> bytes:
        claims = self._server.claims
        types = []
        for name in names:
            if name not in INPUTS:
                types.append("NOT_FOUND")
            elif claims.get(name, self) is not self:
                types.append("IN_USE")
            else:
                types.append(INPUTS[name])
        good = "NOT_FOUND" not in types and "IN_USE" not in types and len(self._inputs) < 255
        if good:
            claims.update(dict.fromkeys(names, self))
            self._inputs.append(InputRecipe(names, self._server.controller))
        return bytes((len(self._inputs) if good else 0,)) + ",".join(types).encode()

    def _data(self, payload: bytes) -> None:
        number = payload[0] if payload else 0
        if not 0 < number <= len(self._inputs) or not self._inputs[number - 1].apply(payload):
            log.info("input package of %d bytes fits no recipe", len(payload))
