"""Maps of Modbus devices in YAML (docs/reference/modbus-map.md): their data, and how they are read and checked."""

import ast
import re
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar

import msgspec
import yaml
from msgspec import field
from msgspec.structs import replace

from arcor2_hw.analysis.units import unit_in
from arcor2_hw.data.base import UNSET, Data, Unset, is_valid_name
from arcor2_hw.data.modbus_point import Point, Value, WordOrder
from arcor2_hw.exceptions import InvalidData, NotFound

T = TypeVar("T")
Values = dict[str, Value]
Keys = tuple[str, ...]
"""Keys from the top of the file."""
BASES: Final = ("generic", "connected", "polled_control", "modbus_device", "mapped_device")
"""Modules of `arcor2_hw.objects` with the bases of a generated type, whose names it must not use."""
OWNERS: Final = ("us", "nobody")
MAX_TIME: Final = 3600.0
"""Longest time in a map, s."""
MAX_NAME: Final = 40
MAX_TEXT: Final = 80
"""Maximum lengths of texts that become lines of the source code."""
TEXT: Final = r'[^"\\\n]*'
Text = Annotated[str, msgspec.Meta(min_length=1, max_length=MAX_TEXT, pattern=f"^{TEXT}$")]


class _Part(Data, frozen=True, forbid_unknown_fields=True):
    """A part of a map."""


class Wait(_Part, frozen=True):
    """Values that are awaited, for at most `within` s."""

    when: Values
    within: float


class Command(_Part, frozen=True):
    """A command: it writes the parameters and `write`, waits for `acknowledge` and `done`, and writes `after`."""

    text: Text
    parameters: list[str] = field(default_factory=list)
    write: Values = field(default_factory=dict)
    acknowledge: Wait | Unset = UNSET
    done: Wait | Unset = UNSET
    ok: Values = field(default_factory=dict)
    after: Values = field(default_factory=dict)
    returns: list[str] = field(default_factory=list)


class FaultText(_Part, frozen=True):
    """Meaning and remedy of a fault."""

    text: str
    remedy: str


class Fault(_Part, frozen=True):
    """The point with the number of the fault, 0 for none, and texts by number."""

    point: str
    texts: dict[int, FaultText] = field(default_factory=dict)


class Heartbeat(_Part, frozen=True):
    """The point to which a changing number is written every `period` s."""

    point: str
    period: float


class Control(_Part, frozen=True):
    """Values that are written to take and to release control, and the point that shows the owner."""

    take: Values = field(default_factory=dict)
    release: Values = field(default_factory=dict)
    owner: str | Unset = UNSET
    heartbeat: Heartbeat | Unset = UNSET


class StopsWithin(_Part, frozen=True):
    """The reaction to a connection loss: motion ends within this time, s."""

    stops_within: float


class DeviceMap(_Part, frozen=True, kw_only=True):
    """A device. `points` and `commands` are read separately, so that errors name them."""

    name: Annotated[str, msgspec.Meta(min_length=1, max_length=MAX_NAME, pattern=f"^{TEXT}$")]
    text: Text
    loss_reaction: Literal["holds", "continues"] | StopsWithin
    word_order: WordOrder = "high_first"
    busy: Values = field(default_factory=dict)
    stop: Values | Unset = UNSET
    control: Control = Control()
    fault: Fault | Unset = UNSET
    points: dict[str, Point] = field(default_factory=dict)
    commands: dict[str, Command] = field(default_factory=dict)


class _Wrong(Exception):
    """An entry is not valid."""

    def __init__(self, path: Keys, reason: str) -> None:
        super().__init__(reason)
        self.path, self.reason = path, reason


def read_map(file: Path) -> DeviceMap:
    """Read a map.

    Raises:
        NotFound: The file does not exist.
        InvalidData: It is not valid. The message names file, line, keys, value and reason.
    """
    root = None
    try:
        text = file.read_text(encoding="utf-8")
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        _check_unique(root, ())
        device = _converted(yaml.safe_load(text))
        for path, reason in _problems(device):
            raise _Wrong(path, reason)
    except FileNotFoundError:
        raise NotFound("{file} does not exist", file=file) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidData("{file} cannot be read: {reason}", file=file, reason=error) from None
    except (yaml.YAMLError, RecursionError) as error:
        raise InvalidData("{file} is not YAML: {reason}", file=file, reason=" ".join(str(error).split())) from None
    except _Wrong as wrong:
        raise InvalidData(
            "{file}, line {line}: {path}: {reason}",
            file=file,
            line=_line(root, wrong.path),
            path=".".join(wrong.path) or "the map",
            reason=wrong.reason,
        ) from None
    return device


# ---------------------------------------------------------------------------------------------------- YAML
def _check_unique(node: yaml.Node | None, path: Keys) -> None:
    """Check that no key is repeated, because YAML would silently use the last one."""
    if not isinstance(node, yaml.MappingNode):
        return
    keys = [key.value for key, _ in node.value]
    for key, value in node.value:
        if keys.count(key.value) > 1:
            raise _Wrong((*path, str(key.value)), "this key is repeated")
        _check_unique(value, (*path, str(key.value)))


def _line(node: yaml.Node | None, path: Keys) -> int:
    """Return the line of the last key of a path that exists, from 1."""
    line = 1
    for name in path:
        found = [(key, value) for key, value in getattr(node, "value", ()) if getattr(key, "value", None) == name]
        if not found:
            break
        line, node = found[0][0].start_mark.line + 1, found[0][1]
    return line


def _converted(raw: Any) -> DeviceMap:
    if not isinstance(raw, dict):
        raise _Wrong((), "it must be a mapping with name, text, loss_reaction and points")
    entries: dict[str, dict[str, Any]] = {}
    for key, kind in (("points", Point), ("commands", Command)):
        given = raw.pop(key, {})
        if not isinstance(given, dict):
            raise _Wrong((key,), f"it must be a mapping of names, not {given!r}")
        entries[key] = {str(name): _convert(entry, kind, (key, str(name))) for name, entry in given.items()}
    device = _convert(raw, DeviceMap, ())
    order = device.word_order
    points = {
        name: replace(point, word_order=order) if point.size > 1 and point.word_order is UNSET else point
        for name, point in entries["points"].items()
    }
    return replace(device, points=points, commands=entries["commands"])


def _convert(raw: Any, kind: type[T], path: Keys) -> T:
    try:
        return msgspec.convert(raw, kind)
    except msgspec.ValidationError as error:
        reason, _, inside = str(error).partition(" - at `$")
        found = raw
        for key in re.findall(r"\.(\w+)", inside):
            path = (*path, key)
            found = found.get(key) if isinstance(found, dict) else found
        shown = not isinstance(found, dict) and repr(found) not in reason
        value = f", not {found!r}" if inside and shown else ""
        raise _Wrong(path, reason + value) from None


# ---------------------------------------------------------------------------------------------------- checks
def actions_of(name: str, point: Point) -> list[str]:
    """Return the names of the actions of a point."""
    if point.internal:
        return []
    found = [f"get_{name}"] if point.readable else []
    found += [f"wait_for_{name}"] if point.readable and point.kind is bool and not point.writable else []
    return found + ([f"set_{name}"] if point.readable and point.writable else [])


def _problems(device: DeviceMap) -> Iterator[tuple[Keys, str]]:
    """Yield keys and reason of each contradiction."""
    if not device.points:
        yield ("points",), "the map has no points"
    reserved = _reserved()
    for name, point in device.points.items():
        yield from _of_a_point(("points", name), name, point)
        if taken := reserved.intersection(actions := actions_of(name, point)):
            yield ("points", name), f"{name!r} cannot be the name of a point: {min(taken)} is used already"
        reserved.update(actions)
    yield from _overlaps(device.points)
    for name, command in device.commands.items():
        path = ("commands", name)
        if not is_valid_name(name) or name in reserved:
            yield path, f"{name!r} cannot be the name of an action: it is not an identifier, or is used already"
        yield from _of_a_command(path, command, device)
    yield from _values(("busy",), device.busy, device, write=False)
    yield from _values(("stop",), {} if isinstance(device.stop, Unset) else device.stop, device, write=True)
    if device.commands and device.stop is UNSET:
        yield ("stop",), "it is missing: state what is written to stop a command, or {} if nothing stops the device"
    if isinstance(device.loss_reaction, StopsWithin):
        yield from _time(("loss_reaction", "stops_within"), device.loss_reaction.stops_within)
    yield from _of_control(device)
    if not isinstance(device.fault, Unset):
        yield from _known(("fault", "point"), device.fault.point, device, write=False)
        if (found := device.points.get(device.fault.point)) is not None and (found.kind is not int):
            yield ("fault", "point"), f"{device.fault.point} must be a whole number without scale and values"


def _of_a_point(path: Keys, name: str, point: Point) -> Iterator[tuple[Keys, str]]:
    if not is_valid_name(name) or name in ("self", "an", "settings"):
        yield path, f"{name!r} is not a valid name"
    if not point.internal and not point.text:
        yield path, "text is missing: users see it; points without actions have `internal: true`"
    if not re.fullmatch(TEXT, point.text) or len(point.text) > MAX_TEXT:
        yield (*path, "text"), f"must be one line of up to {MAX_TEXT} characters without quotes and backslashes"
    if point.unit and unit_in(f"value, {point.unit}") != point.unit:
        yield (*path, "unit"), f"the unit {point.unit!r} is not known; examples are N m, mm/s, °C, bar, %, ml and rpm"


def _overlaps(points: Mapping[str, Point]) -> Iterator[tuple[Keys, str]]:
    taken: dict[tuple[str, int], list[str]] = {}
    for name, point in points.items():
        for address in range(point.address, point.address + point.size):
            others = taken.setdefault((point.table, address), [])
            bits = [points[other].bit for other in others]
            if bits and (point.bit in bits or UNSET in (point.bit, *bits)):
                yield ("points", name, "address"), f"{point.table} {address} also belongs to {others[0]}"
            others.append(name)


def _of_a_command(path: Keys, command: Command, device: DeviceMap) -> Iterator[tuple[Keys, str]]:
    if command.acknowledge is UNSET and command.done is UNSET:
        yield (
            path,
            "acknowledge or done is missing: one of them is required to detect the end of a command",
        )
    for key, wait in (("acknowledge", command.acknowledge), ("done", command.done)):
        if isinstance(wait, Unset):
            continue
        if not wait.when:
            yield (*path, key, "when"), "it is empty"
        yield from _time((*path, key, "within"), wait.within)
        yield from _values((*path, key, "when"), wait.when, device, write=False)
    written = [*command.parameters, *command.write]
    if not written or len({*written}) < len(written):
        yield (*path, "write"), f"each point must be written once, not {', '.join(written) or 'none'}"
    for key, values, write in (
        ("write", command.write, True),
        ("after", command.after, True),
        ("ok", command.ok, False),
    ):
        yield from _values((*path, key), values, device, write=write)
    for key, names, write in (("parameters", command.parameters, True), ("returns", command.returns, False)):
        for name in names:
            yield from _known((*path, key), name, device, write=write)
            if write and name in device.points and not device.points[name].text:
                yield ("points", name), f"text is missing: it is a parameter of {path[-1]}"


def _of_control(device: DeviceMap) -> Iterator[tuple[Keys, str]]:
    control = device.control
    for key, values in (("take", control.take), ("release", control.release)):
        yield from _values(("control", key), values, device, write=True)
    if not isinstance(control.owner, Unset):
        yield from _known(("control", "owner"), control.owner, device, write=False)
        texts = device.points[control.owner].values.values() if control.owner in device.points else OWNERS
        if not set(OWNERS) <= set(texts):
            yield ("control", "owner"), f"the values of {control.owner} must contain the texts us and nobody"
    if not isinstance(control.heartbeat, Unset):
        yield from _known(("control", "heartbeat", "point"), control.heartbeat.point, device, write=True)
        yield from _time(("control", "heartbeat", "period"), control.heartbeat.period)


def _time(path: Keys, seconds: float) -> Iterator[tuple[Keys, str]]:
    if not 0.0 < seconds <= MAX_TIME:
        yield path, f"must be more than 0 and at most {MAX_TIME:g} s, not {seconds!r}"


def _known(path: Keys, name: str, device: DeviceMap, *, write: bool) -> Iterator[tuple[Keys, str]]:
    point = device.points.get(name)
    if point is None:
        yield path, f"point {name!r} does not exist"
    elif not (point.writable if write else point.readable):
        yield path, f"{name} is not {'written' if write else 'read'}; set its access"


def _values(path: Keys, values: Values, device: DeviceMap, *, write: bool) -> Iterator[tuple[Keys, str]]:
    for name, value in values.items():
        yield from _known((*path, name), name, device, write=write)
        try:
            if name in device.points:
                device.points[name].number(value)
        except ValueError as error:
            yield (*path, name), f"{error}, not {value!r}"


def _reserved() -> set[str]:
    """Return the names of methods and attributes of the bases, without importing them."""
    found = {"name", "id"}
    for module in BASES:
        tree = ast.parse((files("arcor2_hw.objects") / f"{module}.py").read_bytes())
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                found.add(node.name)
            elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self":
                found.add(node.attr)
    return found
