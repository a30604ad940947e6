"""Maps of Modbus devices: each mistake is refused with file, line, keys, value and reason."""

from pathlib import Path

import pytest

from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.cli.device_map import read_map
from tests import commands

EXAMPLES = Path(__file__).parents[3] / "docs" / "examples"
MAP = """\
name: Press
text: Presses.
loss_reaction: {stops_within: 1.0}
points:
  force: {table: input_register, address: 4, type: float32, unit: N, text: the force}
  mode: {table: holding_register, address: 1, values: {0: soft, 1: hard}, text: the mode}
  busy: {table: discrete_input, address: 0, text: whether it presses}
  start: {table: coil, address: 0, internal: true}
busy: {busy: true}
stop: {start: false}
commands:
  press:
    text: Press a part.
    parameters: [mode]
    write: {start: true}
    done: {when: {busy: false}, within: 5.0}
    returns: [force]
"""


def error_of(tmp_path: Path, old: str, new: str) -> str:
    """Return the error of the map with a text replaced."""
    assert old in MAP
    file = tmp_path / "press.yaml"
    file.write_text(MAP.replace(old, new))
    with pytest.raises(InvalidData) as error:
        read_map(file)
    message = str(error.value)
    assert message.startswith(f"{file}")
    return message.removeprefix(f"{file}")


@pytest.mark.parametrize("name", ["dispenser", "screwdriver"])
def test_the_examples_are_valid(name: str) -> None:
    assert read_map(EXAMPLES / f"{name}.yaml").commands


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        # points
        ("address: 1,", "address: 65536,", ", line 6: points.mode: address must be 0 to 65535, not 65536"),
        ("address: 4,", "address: 65535,", ", line 5: points.force: address must be 0 to 65534, not 65535"),
        ("type: float32", "type: float16", ", line 5: points.force.type: Invalid enum value 'float16'"),
        ("address: 1,", "address: one,", ", line 6: points.mode.address: Expected `int`, got `str`, not 'one'"),
        ("type: float32,", "type: float32, scale: 0,", ", line 5: points.force: scale must not be 0"),
        ("unit: N,", "unit: newtons,", ", line 5: points.force.unit: the unit 'newtons' is not known"),
        ("{0: soft, 1: hard}", "{0: soft, 1: soft}", ", line 6: points.mode: values must be different texts"),
        ("{0: soft, 1: hard}", "{0: soft, 0: hard}", ", line 6: points.mode.values.0: this key is repeated"),
        ("{0: soft, 1: hard}", "{0: off, 1: on}", ", line 6: points.mode.values: Expected `str`, got `bool`"),
        ("address: 0, internal", "type: float32, address: 0, internal", ", line 8: points.start: type, word_order"),
        ("coil, address: 0", "coils, address: 0", ", line 8: points.start.table: Invalid enum value 'coils'"),
        ("address: 0, internal", "addres_: 0, internal", ", line 8: points.start: Object contains unknown field"),
        ("address: 0, internal", "intern", ", line 8: points.start: "),
        ("  start:", "  busy:", ", line 7: points.busy: this key is repeated"),
        ("address: 1,", "address: 1, debounce: 0.1,", ", line 6: points.mode: only a coil, a discrete input or a bit"),
        (", text: the force", "", ", line 5: points.force: text is missing"),
        ("text: the force", "text: 'a \"force\"'", ", line 5: points.force.text: must be one line of up to 80"),
        ("  start:", "  my-start:", ", line 8: points.my-start: 'my-start' is not a valid name"),
        (
            "  busy: {table",
            "  other: {table: input_register, address: 5, text: another}\n  busy: {table",
            ", line 7: points.other.address: input_register 5 also belongs to force",
        ),
        (
            "  busy: {table",
            "  flag: {table: input_register, address: 4, bit: 1, text: a flag}\n  busy: {table",
            ", line 7: points.flag.address: input_register 4 also belongs to force",
        ),
        # commands
        ("    done: {when: {busy: false}, within: 5.0}\n", "", ", line 12: commands.press: acknowledge or done is"),
        (", within: 5.0", "", ", line 16: commands.press.done: Object missing required field `within`"),
        ("within: 5.0", "within: 0", ", line 16: commands.press.done.within: must be more than 0 and at"),
        ("{start: true}", "{start: 1}", ", line 15: commands.press.write.start: must be true or false, not 1"),
        ("{start: true}", "{force: 1.0}", ", line 15: commands.press.write.force: force is not written"),
        ("{start: true}", "{begin: true}", ", line 15: commands.press.write.begin: point 'begin' does not exist"),
        ("[mode]\n    write: {start: true}", "[]\n    write: {mode: x}", ", line 15: commands.press.write.mode: mu"),
        ("within: 5.0", "within: .inf", ", line 16: commands.press.done.within: must be more than 0 and at"),
        ("[mode]", "[mode, mode]", ", line 15: commands.press.write: each point must be written once, not mode, m"),
        ("{start: true}", "{mode: soft}", ", line 15: commands.press.write: each point must be written once, not"),
        ("[mode]", "[speed]", ", line 14: commands.press.parameters: point 'speed' does not exist"),
        ("[force]", "[start]", ", line 17: commands.press.returns: start is not read; set its access"),
        ("{busy: false}", "{start: false}", ", line 16: commands.press.done.when.start: start is not read"),
        ("  press:", "  stop:", ", line 12: commands.stop: 'stop' cannot be the name of an action"),
        ("  press:", "  get_force:", ", line 12: commands.get_force: 'get_force' cannot be the name of an action"),
        ("text: Press a part.", "text: ''", ", line 13: commands.press.text: Expected `str` of length >= 1, not ''"),
        # the device
        ("stop: {start: false}\n", "", ", line 1: stop: it is missing: state what is written to stop a command"),
        ("{stops_within: 1.0}", "{stops_within: 0}", ", line 3: loss_reaction.stops_within: must be more than 0 and"),
        ("{stops_within: 1.0}", "stops", ", line 3: loss_reaction: "),
        ("loss_reaction: {stops_within: 1.0}\n", "", ", line 1: the map: Object missing required field"),
        ("busy: {busy: true}", "busy: {busy: 1}", ", line 9: busy.busy: must be true or false, not 1"),
        ("busy: {busy: true}", "control: {owner: mode}", ", line 9: control.owner: mode is not read"),
        ("busy: {busy: true}", "control: {owner: force}", ", line 9: control.owner: the values of force must contain"),
        ("busy: {busy: true}", "control: {heartbeat: {point: life, period: 1}}", ", line 9: control.heartbeat.point: "),
        ("busy: {busy: true}", "fault: {point: force}", ", line 9: fault.point: force must be a whole number"),
        ("busy: {busy: true}", "is_busy: {busy: true}", ", line 1: the map: Object contains unknown field `is_busy`"),
        ("points:\n", "points: [1]\nother:\n", ", line 4: points: it must be a mapping of names, not [1]"),
        ("text: Presses.", "text: [", " is not YAML: while parsing a flow sequence"),
        ("text: Presses.", "text: &a {b: *a}", " is not YAML: maximum recursion depth exceeded"),
        (MAP, "- a\n", ", line 1: the map: it must be a mapping"),
        (MAP, "", ", line 1: the map: it must be a mapping"),
    ],
)  # fmt: skip
def test_the_error_names_the_line_and_the_mistake(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert error_of(tmp_path, old, new).startswith(expected)


def test_the_error_names_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(NotFound, match=r"none\.yaml does not exist"):
        read_map(tmp_path / "none.yaml")


def test_bits_may_share_a_register(tmp_path: Path) -> None:
    file = tmp_path / "press.yaml"
    flags = [f"  flag{n}: {{table: input_register, address: 9, bit: {n}, text: a flag}}\n" for n in (0, 15)]

    file.write_text(MAP.replace("  start:", f"{''.join(flags)}  start:", 1))
    assert [read_map(file).points[f"flag{n}"].bit for n in (0, 15)] == [0, 15]


def test_points_use_the_word_order_of_the_map_by_default(tmp_path: Path) -> None:
    file = tmp_path / "press.yaml"
    file.write_text(MAP.replace("points:", "word_order: low_first\npoints:", 1))
    points = read_map(file).points
    assert points["force"].word_order == "low_first"
    file.write_text(MAP.replace("type: float32", "type: float32, word_order: high_first"))
    assert read_map(file).points["force"].word_order == "high_first"


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["press", "--from-map", "MAP", "--base", "machine", "--bus", "modbus"], "either --base and --bus, or"),
        (["press", "--from-map", "MAP", "--bus", "modbus"], "either --base and --bus, or"),
        (["press", "--base", "machine"], "either --base and --bus, or --from-map"),
        (["press"], "either --base and --bus, or --from-map"),
        (["press", "--from-map", "none.yaml"], "none.yaml does not exist"),
        (["Press!", "--from-map", "MAP"], "invalid name"),
        (["press", "--from-map", "BAD"], "bad.yaml, line 6: points.mode: address must be 0 to 65535"),
    ],
)
def test_the_command_refuses_mistakes_in_one_line(tmp_path: Path, arguments: list[str], expected: str) -> None:
    (tmp_path / "press.yaml").write_text(MAP)
    (tmp_path / "bad.yaml").write_text(MAP.replace("address: 1,", "address: -1,"))
    files = {"MAP": "press.yaml", "BAD": "bad.yaml"}
    done = commands.run(commands.CLI, "device", "new", *(files.get(each, each) for each in arguments), cwd=tmp_path)
    assert done.returncode == 2
    assert expected in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.yaml", "press.yaml"]
