"""CellBench: a bench of a device in a cell.yaml, created from its type and settings, with a wire."""

import contextlib
import dataclasses
import importlib
import inspect
import json
import socket
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, ClassVar, Final

from arcor2_hw.data.base import Unset
from arcor2_hw.data.cell import CellDevice, read_cell
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_hw.objects import Generic, GenericWithPose, IOBlock
from arcor2_hw.runtime.creation import fill_settings, find_type, recipe
from arcor2_hw.testing import capabilities, frames, quality
from arcor2_hw.testing.addresses import Place, own_loopback, places
from arcor2_hw.testing.bench import OF_THE_WIRE, Bench
from arcor2_hw.testing.serial_wire import SerialWire

READ: Final = ("machine_state", "robot_joints", "position", "state", "status", "vacuum", "identify")
"""Methods of which the first available one is used for readings of an unknown device."""
QUERIED: Final = ("identify", "machine_state", "position", "status")
"""Methods that communicate with the device."""


class CellBench(Bench):
    """A device of a cell. A subclass named by `bench` may add what cannot be guessed: `command`, `run_long`."""

    entry: ClassVar[CellDevice]
    connect_timeout: ClassVar[float] = 5.0
    call_within: ClassVar[float] = 6.0
    stale_after: ClassVar[float] = 2.0
    lost_within: ClassVar[float] = 6.0
    back_within: ClassVar[float] = 15.0
    stops_within: ClassVar[float] = 2.0

    def __init__(self) -> None:
        super().__init__()
        found = places(all_settings(self.entry, self.object_type), _named(self.entry))
        self.place: Place | None = found[0] if found else None
        self._moved: dict[str, Any] = {}
        self._closed: socket.socket | None = None
        said = capabilities.declared(self.object_type)
        self._read = self._first(READ, said)
        self._queried = self._first(QUERIED, said) or self._read

    def _first(self, names: Iterable[str], said: frozenset[str]) -> str:
        abstract = {name for base in self.object_type.__mro__ for name in getattr(base, "__abstractmethods__", ())}
        for name in names:
            method = getattr(self.object_type, name, None)
            if name in said | abstract and callable(method):
                required = [p for p in inspect.signature(method).parameters.values() if p.default is p.empty]
                if len(required) == 1:
                    return name
        return "read" if issubclass(self.object_type, IOBlock) else ""

    # -------------------------------------------------------------------------------- the device
    @property
    def address(self) -> str:
        """Return the text by which errors have to identify the device."""
        if self.place is None:
            return self.entry.name
        if self.wire is None:
            return self.place.error_text
        return str(self._moved[self.place.settings[-1]]) if not self.place.url else self.wire.address

    def make(self) -> Generic:
        """Create the object like the cell host does, at the near end of the wire."""
        return self._made_with(self._moved)

    def _made_with(self, moved: Mapping[str, Any]) -> Generic:
        values = dict(self.entry.settings) | dict(moved)
        parameters = [_parameter(name, value) for name, value in values.items()]
        pose = self.entry.pose
        if isinstance(pose, Unset) and issubclass(self.object_type, GenericWithPose):
            pose = Pose()
        scene_object = SceneObject(
            self.entry.name, self.object_type.__name__, pose, parameters=parameters, id=f"obj_{self.entry.name}"
        )
        return recipe(scene_object, self.object_type, None).make()

    def lay_wire(self) -> None:
        """Create the wire without opening anything, so that the hooks that it provides are known."""
        self.wire = None if self.place is None else self.place.wire()
        if self.wire is not None:
            self.frames = self._frames()

    def start(self) -> None:
        """Put the wire in front of the device."""
        self.lay_wire()
        if self.wire is not None and self.place is not None:
            self.wire.start()
            self._moved = self.place.behind(self.wire)

    def _frames(self) -> frames.Frames | None:
        with contextlib.suppress(Arcor2Error):
            serial = isinstance(self.wire, SerialWire)
            for kind, words in quality.read(self.quality_file()).frames.items():
                if kind == "lines" or (kind == "modbus-rtu" if serial else kind != "modbus-rtu"):
                    return frames.reader(kind, words)
        return None

    def end(self) -> None:
        """Remove the wire."""
        if self.wire is not None:
            self.wire.close()
        if self._closed is not None:
            self._closed.close()

    def reset(self) -> None:
        """Repair the wire; other states of the device are unknown."""
        if self.wire is not None:
            self.wire.heal()

    # -------------------------------------------------------------------------------- hooks
    def absent(self) -> tuple[Generic, str]:
        """Return an object at a port without a listener, or at a port that does not exist."""
        assert self.place is not None
        if self.place.fixed:
            host = own_loopback()
            return self._made_with({self.place.settings[0]: host}), host
        if self._closed is None:
            self._closed = socket.socket()
            self._closed.bind(("127.0.0.1", 0))  # without listening, so that no other process takes the port
        port = int(self._closed.getsockname()[1])
        path = str(Path(tempfile.gettempdir()) / "arcor2-hw-no-such-port")
        there = self.place.moved("127.0.0.1", port, path)
        return self._made_with(there), path if self.place.path else str(port)

    def writes(self) -> Any:
        """Return the acting frames that the wire recorded."""
        return list(self.actuating())

    def observe(self, device: Generic) -> object:
        """Take the first reading that the type has."""
        return self._call(device, self._read)

    def ask(self, device: Generic) -> object:
        """Call a method that communicates with the device."""
        return self._call(device, self._queried)

    def _call(self, device: Generic, name: str) -> object:
        if name == "read" and isinstance(device, IOBlock):
            return device.read(device.points()[0].name)
        call: Callable[[], object] = getattr(device, name)
        return call()

    def has(self, hook: str) -> bool:
        """Return whether the bench has a hook."""
        own = getattr(type(self), hook) is not getattr(CellBench, hook)
        if own or self._lack(hook) is None:
            return super().has(hook)
        return False

    def why_not(self, hook: str) -> str | None:
        """Return why a hook cannot be guessed."""
        return self._lack(hook)

    def _lack(self, hook: str) -> str | None:
        if hook in OF_THE_WIRE and self.wire is None:
            return "no wire is possible. `wire` must name host and port, the port, or fixed ports."
        if hook == "absent" and (self.place is None or not self.place.error_text):
            return "its settings do not contain an address for a missing device"
        if hook in ("writes", "actuating") and (self.wire is None or self.frames is None):
            return "its frames are unknown, because quality.yaml has no `frames` for this wire"
        if hook in ("observe", "ask") and not self._read:
            return "it has no reading without arguments"
        if hook in _UNKNOWN and not (hook == "works" and super().has(hook)):
            return "its commands are unknown. Name a bench by `bench: module:Class`."
        return None


_UNKNOWN: Final = frozenset(
    {
        *("command", "run_long", "running", "foreign", "orphan", "holding", "progress"),
        *("readings", "results", "beyond_limits", "works"),
    }
)


def _parameter(name: str, value: Any) -> Parameter:
    kind = {bool: "boolean", int: "integer", float: "double"}.get(type(value), "string")
    return Parameter(name, kind, json.dumps(value))


def _named(entry: CellDevice) -> list[str | int]:
    return [] if isinstance(entry.wire, Unset) else entry.wire


def all_settings(entry: CellDevice, kind: type[Generic]) -> dict[str, Any]:
    """Return the settings of a device with their defaults.

    Raises:
        InvalidData: A setting is invalid; the message names device and setting.
    """
    filled = fill_settings(kind, entry.name, {name: _parameter(name, value) for name, value in entry.settings.items()})
    return {} if filled is None else dataclasses.asdict(filled)


def is_real(entry: CellDevice, kind: type[Generic]) -> bool:
    """Return whether a device counts as real: it is declared real, or its address is not on this machine."""
    if not isinstance(entry.real, Unset):
        return entry.real
    found = places(all_settings(entry, kind))
    return not found or not all(place.here for place in found)


def bench_of(entry: CellDevice) -> type[Bench]:
    """Create the bench of a device.

    Raises:
        Arcor2Error: It cannot be created; the message names the device.
    """
    base: type[Bench] = CellBench
    if not isinstance(entry.bench, Unset):
        base = _bench_named(entry)
    try:
        kind = base.object_type if hasattr(base, "object_type") else find_type(entry.type)
    except Arcor2Error as error:
        raise type(error)("{name}: {reason}", name=entry.name, reason=error) from error
    if kind.__name__ != entry.type:
        raise InvalidData(
            "{name}: the bench {bench} is for {type}, not for {entry_type}",
            name=entry.name,
            bench=entry.bench,
            type=kind.__name__,
            entry_type=entry.type,
        )
    try:
        places(all_settings(entry, kind), _named(entry))
    except KeyError as error:
        raise InvalidData(
            "{name}: wire names {reason}, which is not a setting of {type}",
            name=entry.name,
            reason=error,
            type=entry.type,
        ) from None
    # A custom bench without settings from the cell has its own device, and decides itself whether it is real.
    own = not issubclass(base, CellBench) and not entry.settings and isinstance(entry.real, Unset)
    real = base.real or (not own and is_real(entry, kind))
    members = {"entry": entry, "object_type": kind, "label": entry.name, "guessed": base is CellBench, "real": real}
    return type(f"{base.__name__}_{entry.name}", (base,), members)


def _bench_named(entry: CellDevice) -> type[Bench]:
    module, _, name = str(entry.bench).partition(":")
    try:
        found = getattr(importlib.import_module(module), name, None)
    except ImportError as error:
        raise InvalidData(
            "{name}: the bench {bench} cannot be imported: {reason}", name=entry.name, bench=entry.bench, reason=error
        ) from error
    if not (isinstance(found, type) and issubclass(found, Bench)):
        raise InvalidData("{name}: {bench} is not a bench", name=entry.name, bench=entry.bench)
    return found


def benches_of_files(files: Iterable[str]) -> list[type[Bench]]:
    """Return the benches of all devices of several cell.yaml files, which must have different names.

    Raises:
        Arcor2Error: A bench cannot be created, or a name is repeated.
    """
    entries = [entry for file in files for entry in read_cell(Path(file)).devices]
    names = [entry.name for entry in entries]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InvalidData("several cell.yaml files have devices of the same name: {twice}", twice=", ".join(twice))
    return [bench_of(entry) for entry in entries]
