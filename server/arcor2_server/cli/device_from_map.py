"""Writes the source code of a driver, and texts about it, from the map of a Modbus device."""

import json
import re
from collections.abc import Iterable, Mapping
from typing import Any, Final

from arcor2_hw.data.base import Unset
from arcor2_hw.data.modbus_point import Point
from arcor2_server.cli.device_map import Command, DeviceMap, StopsWithin, Wait, actions_of

WIDTH: Final = 120
"""Maximum length of a line."""
DEFAULT_DEADLINE: Final = 100.0
"""Sum of the time limits of a command above which its action declares a deadline, s."""
MAX_WAIT: Final = 600.0
"""Longest time that a program may wait for a point in one call, s."""
MARGIN: Final = 20.0
"""Additional time of an action for its requests, s."""
LONG: Final = 4.0
"""Time limit from which the suite tests a command as a long action, s."""
ACT_CASES: Final = ("nothing_resumes", "loss_reaction", "stop_passes", "one_act_at_a_time", "disconnecting_ends_an_act")
LOSS: Final = {"holds": "it keeps its outputs and starts nothing new", "continues": "it continues its command"}
IMPORTS: Final = """import pytest
{bench}from arcor2_hw.testing.conformance import Conformance
from arcor2_hw.testing.fake_bench import FakeBench, modbus_address
"""
OWN_TEST: Final = """def test_all_points_are_read(bench):
    assert set(bench.connected().fresh()) == {{{names}}}
"""
TABLE: Final = ("", "| name | address | type | scale, unit or values | meaning |", "|---|---|---|---|---|")
Kinds = Mapping[str, str]
"""Names of the enumerations of parameters, by point."""


def words(class_name: str, device: DeviceMap) -> dict[str, str]:
    """Return the values of the placeholders in the templates that depend on the map."""
    points = device.points
    settable = [name for name, point in points.items() if f"set_{name}" in actions_of(name, point)]
    calls = {name: f"{name}({_examples(command.parameters, points)})" for name, command in device.commands.items()}
    calls |= {f"set_{name}": f"set_{name}({_examples([name], points)})" for name in settable}
    longest = max(device.commands, key=lambda name: _within(device.commands[name].done), default="")
    limit = _within(device.commands[longest].done) if longest else 0.0
    run_long = calls[longest] if limit >= LONG and device.stop else ""
    command, reaction = next(iter(calls.values()), ""), device.loss_reaction
    actions = [each for name, point in points.items() for each in actions_of(name, point)]
    not_run = [
        f"  {case}: no command takes longer than {LONG:g} s and can be stopped" for case in ACT_CASES if not run_long
    ]
    if isinstance(device.control.owner, Unset):
        not_run.append("  control_is_refused: the device does not report who has control")
    if run_long and reaction == "holds":
        not_run.append("  loss_reaction: the map does not say what the device holds")
    if not command:
        not_run += [
            f"  {case}: the device is only read" for case in ("command_needs_control", "control_does_not_come_back")
        ]
    return {
        "driver": _driver(class_name, device),
        "actions": ", ".join([*actions, *device.commands]),
        "A_title": device.name,
        "title": device.name,
        "on_loss": "hold" if settable else "none",
        "loss_case": "test_loss_reaction" if run_long else "test_control_does_not_come_back",
        "stdlib": "import sys\n\n" if run_long else "",
        "imports": IMPORTS.format(bench="" if device.control.owner else "from arcor2_hw.testing.bench import Bench\n"),
        "bench_data": _bench_data(device),
        "hooks": _hooks(command, run_long, min(6.0, 0.8 * limit), continues=reaction == "continues"),
        "acts": run_long,
        "level": "bronze",
        "own_test": OWN_TEST.format(names=", ".join(f'"{name}"' for name, point in points.items() if point.readable)),
        "controller": "a fake of the same map",
        "limits": "  - its fake is written from the same map as the driver, so it cannot show errors of the map\n",
        "not_run": "\n".join([*(["not_run:"] if not_run else []), *not_run]),
        "map": "\n".join([*TABLE, *(_row(name, point) for name, point in points.items())]),
        "does": "\n".join(f"- `{name}`: {command.text}" for name, command in device.commands.items()) or "It is read.",
        "loss_sentence": f"it stops within {reaction.stops_within:g} s."
        if isinstance(reaction, StopsWithin)
        else f"{LOSS[reaction]}.",
    }


def _bench_data(device: DeviceMap) -> str:
    """Return the attributes of the bench."""
    foreign = "    foreign = Bench.foreign  # the device does not report who has control\n"
    independent = "    independent = False  # the fake is written from the same map as the driver\n"
    return independent + (foreign if isinstance(device.control.owner, Unset) else "")


def _hooks(command: str, run_long: str, seconds: float, *, continues: bool) -> str:
    """Return the hooks of the bench that depend on the map."""
    lines = [f"\n    def command(self, device):\n        return device.{command}\n"] if command else []
    if run_long:
        lines.append(
            f'\n    def run_long(self, device):\n        self.do("last", seconds={seconds:g})\n'
            f'        return device.{run_long}\n\n    def running(self):\n        return self.do("truth")["busy"]\n\n'
            f'    def orphan(self):\n        self.do("last", seconds={seconds:g})\n'
            '        return [sys.executable, "-c", ORPHAN, self.address]\n'
        )
    if run_long and continues:
        lines.append('\n    def progress(self):\n        return self.do("truth")["done"]\n')
    return "".join(lines)


def _row(name: str, point: Point) -> str:
    """Return a row of the table of points."""
    bit = "" if isinstance(point.bit, Unset) else f", bit {point.bit}"
    kind = point.kind.__name__ if isinstance(point.type, Unset) else point.type
    meaning = ", ".join(f"{number}: {text}" for number, text in point.values.items())
    scale = f"{point.scale:g} {point.unit}" if point.scale != 1.0 else point.unit
    place = f"{point.table.replace('_', ' ')} {point.address}{bit}"
    return f"| {name} | {place} | {kind} | {meaning or scale} | {point.text} |"


def _examples(parameters: Iterable[str], points: Mapping[str, Point]) -> str:
    """Return valid arguments as source code."""
    return ", ".join(_literal(_example(points[each])) for each in parameters)


def _example(point: Point) -> Any:
    if point.kind is bool:
        return True
    return (
        next(iter(point.values.values())) if point.values else point.kind(max(point.limits[0], min(point.limits[1], 1)))
    )


# ---------------------------------------------------------------------------------------------------- source code
def _literal(value: Any) -> str:
    """Return the source code of a number, a text, or a dictionary or tuple of them."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_literal(key)}: {_literal(each)}" for key, each in value.items()) + "}"
    if isinstance(value, tuple):
        return "(" + ", ".join(map(_literal, value)) + ")"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)


def _call(start: str, arguments: Iterable[str], end: str, indent: int) -> str:
    """Return a call as source code, with one argument per line if one line is too short."""
    arguments, space = list(arguments), " " * indent
    line = f"{space}{start}{', '.join(arguments)}{end}"
    lines = [f"{space}    {each}," for each in arguments]
    return line if len(line) <= WIDTH else "\n".join([space + start, *lines, space + end])


def _driver(class_name: str, device: DeviceMap) -> str:
    points, reaction, fault = device.points, device.loss_reaction, device.fault
    taken = {each for command in device.commands.values() for each in command.parameters}
    kinds = {
        name: class_name + "".join(part.capitalize() for part in name.split("_"))
        for name, point in points.items()
        if point.values and (name in taken or f"set_{name}" in actions_of(name, point))
    }
    texts = {} if isinstance(fault, Unset) else fault.texts
    loss = f"stops_within({reaction.stops_within!r})" if isinstance(reaction, StopsWithin) else f"{reaction}()"
    lines = [
        f"from arcor2_hw.actions import {'StrEnum, ' if kinds else ''}action",
        "from arcor2_hw.data.device import LossReaction",
        "from arcor2_hw.data.modbus_point import Point",
        "from arcor2_hw.objects import Generic",
        *(["from arcor2_hw.objects.connected import AlarmText"] if texts else []),
        "from arcor2_hw.objects.mapped_device import MappedDevice",
        "from arcor2_hw.objects.modbus_settings import ModbusSettings",
        *(line for name, kind in kinds.items() for line in _enumeration(kind, points[name])),
        "",
        "",
        "@dataclasses.dataclass",
        f"class {class_name}Settings(ModbusSettings):",
        '    """Address of the device, on Modbus TCP or RTU."""',
        "",
        "",
        f"class {class_name}(MappedDevice, Generic):",
        f'    """{device.text}"""',
        "",
        "    _ABSTRACT = False",
        f"    display_name = {_literal(device.name)}",
        f"    loss_reaction = LossReaction.{loss}",
        "    POINTS = {",
        *(_call(f"{_literal(name)}: Point(", _arguments(point), "),", 8) for name, point in points.items()),
        "    }",
        *(f"    {name} = {_literal(value)}" for name, value in _class_data(device).items() if value),
    ]
    if texts:
        lines.append("    ALARMS = {")
        lines += [
            f'        "{n}": AlarmText({_literal(each.text)}, {_literal(each.remedy)}),' for n, each in texts.items()
        ]
        lines.append("    }")
    lines += [
        "",
        f"    def __init__(self, obj_id: str, name: str, settings: {class_name}Settings) -> None:",
        "        super().__init__(obj_id, name, settings)",
        "        self.use_map(settings)",
    ]
    for name, point in points.items():
        lines += _point_actions(name, point, kinds)
    for name, command in device.commands.items():
        lines += _command(name, command, points, kinds)
    return "\n".join(lines)


def _enumeration(class_name: str, point: Point) -> list[str]:
    members: dict[str, str] = {}
    for number, text in point.values.items():
        member = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_").upper()
        member = member if member[:1].isalpha() else f"V{number}_{member}".strip("_")
        members[f"{member}_{number}" if member in members else member] = text
    lines = [f"    {member} = {_literal(text)}" for member, text in members.items()]
    return ["", "", f"class {class_name}(StrEnum):", f'    """Values of {point.text}."""', "", *lines]


def _arguments(point: Point) -> list[str]:
    default = Point(point.table, 0)
    names = [name for name in point.__struct_fields__[2:] if getattr(point, name) != getattr(default, name)]
    return [_literal(point.table), str(point.address), *(f"{name}={_literal(getattr(point, name))}" for name in names)]


def _class_data(device: DeviceMap) -> dict[str, Any]:
    control, beat = device.control, device.control.heartbeat
    return {
        "BUSY": device.busy,
        "STOP": {} if isinstance(device.stop, Unset) else device.stop,
        "TAKE_CONTROL": control.take,
        "RELEASE_CONTROL": control.release,
        "OWNER": "" if isinstance(control.owner, Unset) else control.owner,
        "HEARTBEAT": "" if isinstance(beat, Unset) else beat.point,
        "HEARTBEAT_PERIOD": 0.0 if isinstance(beat, Unset) else beat.period,
        "FAULT": "" if isinstance(device.fault, Unset) else device.fault.point,
    }


def _described(name: str, point: Point) -> str:
    return f"        :param {name}: {point.text}{point.unit and ', ' + point.unit}"


def _range(name: str, point: Point) -> list[str]:
    """Return the assertion of the range of a parameter, if the analysis supports this form."""
    low, high = point.limits
    if point.kind not in (int, float) or low < 0 or (point.is_float and isinstance(point.maximum, Unset)):
        return []
    return [f"        assert {point.kind(low)!r} <= {name} <= {point.kind(high)!r}"]


def _action(
    mark: str, name: str, parameters: list[str], result: str, described: list[str], body: list[str]
) -> list[str]:
    """Return the source code of an action."""
    first, rest = f'        """{described[0]}', described[1:]
    docstring = [first, "", *rest, '        """'] if rest else [first + '"""']
    ranges = [line for line in body if line.lstrip().startswith("assert ")]
    body = [*ranges, "", *body[len(ranges) :]] if ranges else body
    head = _call(f"def {name}(", ["self", *parameters, "*", "an: str | None = None"], f") -> {result}:", 4)
    return ["", f"    {mark}", head, *docstring, *body]


def _point_actions(name: str, point: Point, kinds: Kinds) -> list[str]:
    kind, unit, key = point.kind.__name__, point.unit and ", " + point.unit, _literal(name)
    lines: list[str] = []
    for action in actions_of(name, point):
        if action.startswith("get_"):
            body = [f"        return {kind}(self.read({key}).value)"]
            lines += _action("@action", action, [], kind, [f"Return {point.text}{unit}."], body)
        elif action.startswith("set_"):
            body = [*_range("value", point), f"        self.put_verified({key}, value)"]
            described = [f"Set {point.text}{unit}.", _described("value", point)]
            lines += _action("@action", action, [f"value: {kinds.get(name, kind)}"], "None", described, body)
        else:
            described = [
                f"Wait for a value: {point.text}.",
                "        :param value: the awaited value",
                "        :param timeout: time limit, s",
            ]
            body = [
                f"        assert 0.0 <= timeout <= {MAX_WAIT!r}",
                f"        self.wait_for_value({key}, value, timeout)",
            ]
            mark = f"@action(deadline={MAX_WAIT + MARGIN!r})"
            lines += _action(mark, action, ["value: bool", "timeout: float"], "None", described, body)
    return lines


def _within(wait: Wait | Unset) -> float:
    return 0.0 if isinstance(wait, Unset) else wait.within


def _command(name: str, command: Command, points: Mapping[str, Point], kinds: Kinds) -> list[str]:
    types = [points[each].kind.__name__ for each in command.returns]
    results = [f"{kind}(end[{_literal(each)}])" for kind, each in zip(types, command.returns, strict=True)]
    write = [f"{_literal(each)}: {each}" for each in command.parameters]
    write += [f"{_literal(each)}: {_literal(value)}" for each, value in command.write.items()]
    arguments = [_literal(name), "{" + ", ".join(write) + "}"]
    for key, wait in (("acknowledge", command.acknowledge), ("done", command.done)):
        if not isinstance(wait, Unset):
            arguments.append(f"{key}={_literal((wait.when, wait.within))}")
    arguments += [
        f"{key}={_literal(values)}" for key, values in (("ok", command.ok), ("after", command.after)) if values
    ]
    body = [line for each in command.parameters for line in _range(each, points[each])]
    body.append(_call(("end = " if results else "") + "self.execute(", arguments, ")", 8))
    body += [f"        return {', '.join(results)}"] if results else []
    described = [command.text, *(_described(each, points[each]) for each in command.parameters)]
    total = _within(command.acknowledge) + _within(command.done)
    mark = f"@action(deadline={total + MARGIN!r})" if total > DEFAULT_DEADLINE else "@action"
    signature = [f"{each}: {kinds.get(each) or points[each].kind.__name__}" for each in command.parameters]
    result = f"tuple[{', '.join(types)}]" if types[1:] else next(iter(types), "None")
    return _action(mark, name, signature, result, described, body)
