"""`arcor2-hw device new`: create a driver, a fake, a test and a documentation page from templates."""

import enum
import keyword
import re
import sys
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Annotated, Final, NamedTuple

from cyclopts import Parameter

from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.starter_kinds import KINDS, NO_ACT, Base

MAX_NAME: Final = 24
"""Maximum length of the name of a device."""
STARTER: Final = files("arcor2_server.cli") / "starter"
"""The folder of the templates."""


class Bus(enum.StrEnum):
    """Communication with the device."""

    MODBUS = "modbus"
    SERIAL = "serial"
    TCP = "tcp"
    CAN = "can"
    HTTP = "http"


class Wire(NamedTuple):
    """The parts of the templates that depend on the bus.

    Args:
        title: name of the protocol.
        library: the library and its version.
        extra: the optional dependency of arcor2-hw.
        fields: the settings as name, type, default (empty: none) and description.
        address: the settings in a test, as an expression with `address`.
        absent: an address without a device.
        check: the line that checks the settings.
    """

    title: str
    library: str
    extra: str
    fields: tuple[tuple[str, str, str, str], ...]
    address: str
    absent: str
    check: str


HOST: Final = "host, int(port)"
_PORT_CHECK: Final = "        check_host(self.host, self.port)"

WIRES: Final = {
    Bus.MODBUS: Wire(
        "Modbus TCP",
        "pymodbus 3.16",
        "[modbus]",
        (("host", "str", "", "address or name of the device"), ("port", "int", "502", "port of its Modbus server")),
        HOST,
        "127.0.0.1:1",
        _PORT_CHECK,
    ),
    Bus.TCP: Wire(
        "lines of text over TCP",
        "none",
        "",
        (("host", "str", "", "address or name of the device"), ("port", "int", "4001", "port it listens on")),
        HOST,
        "127.0.0.1:1",
        _PORT_CHECK,
    ),
    Bus.SERIAL: Wire(
        "lines of text on a serial port",
        "pyserial 3.5",
        "[serial]",
        (("port", "str", "", "path of the serial port"), ("baud_rate", "int", "9600", "bits per second")),
        "address",
        "/dev/does-not-exist",
        '        check_serial_port("port", self.port)',
    ),
    Bus.HTTP: Wire(
        "HTTP",
        "httpx 0.28",
        "",
        (("url", "str", "", "URL of the device, such as http://192.168.0.7"),),
        'f"http://{address}"',
        "127.0.0.1:1",
        """        check_url("url", self.url, "http", "https")""",
    ),
}

RANGES: Final = {"baud_rate": "Annotated[int, Range(300, 921600)]"}
"""Types of settings with a range."""
UNSUITABLE: Final = {
    Base.ROBOT: "robots have no template; see docs/how-to/add-a-robot.md and start from a similar driver, such "
    "as drivers/arcor2_drivers/dobot_magician or universal_robots",
    Base.CAMERA: "cameras have no template; they need the library of the manufacturer. Start from "
    "drivers/arcor2_drivers/oak_d",
}
NO_CAN: Final = (
    "CAN has no template; its object dictionary depends on the device. Start from "
    "drivers/arcor2_drivers/conveyor, which uses SDO, PDO, heartbeat and EMCY of CANopen"
)
NO_TEMPLATE: Final = "this base has no template; use --base generic, or start from a similar driver"


def refusal(base: Base, bus: Bus) -> str:
    """Return why there is no template for a base on a bus; empty if there is one."""
    if base in UNSUITABLE:
        return UNSUITABLE[base]
    if bus not in WIRES:
        return NO_CAN
    return "" if base in KINDS else NO_TEMPLATE


def new(
    name: Annotated[
        str, Parameter(help="Name of the device in lower case. It is used for the folder, the module and the class.")
    ],
    *,
    base: Annotated[Base, Parameter(help="Kind of device.")],
    bus: Annotated[Bus, Parameter(help="Communication with the device.")],
    directory: Annotated[Path, Parameter(help="Folder in which the new folder is created.")] = Path(),
) -> int:
    """Create a driver for a new device with a fake, a test and a page. It passes the conformance suite."""
    module = name.replace("-", "_")
    if not re.fullmatch(rf"[a-z][a-z0-9_]{{0,{MAX_NAME - 1}}}", module) or keyword.iskeyword(module):
        reason = f"invalid name {name!r}: use up to {MAX_NAME} lower-case letters, digits and _"
        return fail("device new", reason, ExitStatus.USAGE)
    if reason := refusal(base, bus):
        return fail("device new", f"{base} on {bus}: {reason}", ExitStatus.USAGE)
    root = directory / name
    try:
        root.mkdir(parents=True)
        for path, text in texts(name, base, bus).items():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(text, encoding="utf-8")
    except FileExistsError:
        return fail("device new", f"{root} already exists", ExitStatus.USAGE)
    except OSError as error:
        return fail("device new", f"{root} cannot be written: {error.strerror}", ExitStatus.FAILED)
    sys.stdout.write(f"Created {root}. Run its tests:  cd {root} && python -m pytest\n")
    return ExitStatus.OK


def texts(name: str, base: Base, bus: Bus) -> dict[str, str]:
    """Return the files of a new device by path."""
    module = name.replace("-", "_")
    words = _words(name, module, base, bus)
    words["control"] = _fill("control.txt", words)
    words["long"] = _fill("long.txt", words) if KINDS[base].run_long else ""
    found = {
        f"{module}/__init__.py": f'"""{words["A_title"]}."""\n',
        f"{module}/{module}.py": _fill(f"driver_{base}.py", words),
        f"{module}/{module}_fake.py": _fill(f"fake_{KINDS[base].fake}.py", words),
        f"{module}/quality.yaml": _fill("quality.yaml", words),
        f"tests/test_{module}.py": _fill("test.py", words),
        f"docs/{name}.md": _fill("page.md", words),
        "pyproject.toml": _fill("pyproject.toml", words),
        "cell.yaml": _fill("cell.yaml", words),
    }
    if bus is not Bus.MODBUS:
        found[f"{module}/link.py"] = _fill("link_http.py" if bus is Bus.HTTP else "link_text.py", words)
    return found


def _fill(template: str, words: dict[str, str]) -> str:
    return Template((STARTER / f"{template}.tmpl").read_text(encoding="utf-8")).substitute(words)


def _words(name: str, module: str, base: Base, bus: Bus) -> dict[str, str]:
    """Return the values of the placeholders in the templates."""
    kind, wire = KINDS[base], WIRES[bus]
    class_name = "".join(part.capitalize() for part in module.split("_"))
    title = module.replace("_", " ")
    article = "an" if title[0] in "aeiou" else "a"
    modbus = bus is Bus.MODBUS
    names = [field[0] for field in wire.fields]
    imported = sorted(set(re.findall(r"check_\w+", wire.check)))
    serial = bus is Bus.SERIAL
    stdlib = (["sys"] if kind.run_long else []) + (["threading"] if base is Base.READER else [])
    if serial:
        imported.insert(0, "Range")
    made = ", ".join(f"settings.{field}" for field in names)
    lines = [f"    {n}: {RANGES.get(n, t)}" + (f" = {d}" if d else "") for n, t, d, _ in wire.fields]
    settings = "\n".join(
        [
            "@dataclasses.dataclass",
            f"class {class_name}Settings(Settings):",
            '    """Address of the device.',
            "",
            *(f"    :param {n}: {text}" for n, _, _, text in wire.fields),
            '    """',
            "",
            *lines,
            "",
            "    def __post_init__(self) -> None:",
            "        super().__post_init__()",
            wire.check,
            "",
        ]
    )
    build = [
        *(['host, _, port = address.rpartition(":")'] if wire.address == HOST else []),
        f"settings = {class_name}Settings({wire.address})",
    ]
    made_in_test = "\n".join(f"    {line}" for line in [*build, f'return {class_name}("id", "{module}", settings)'])
    example = {"host": "192.168.0.7", "url": "http://192.168.0.7", "port": "/dev/ttyUSB0" if bus is Bus.SERIAL else ""}
    cell = [f"    {n}: {example.get(n) or d}" for n, _, d, _ in wire.fields]
    write = "write_registers" if modbus else "write"
    not_run = "" if kind.run_long else _not_run()
    orphan = "" if not kind.run_long else _orphan(module, class_name, build, kind.run_long)
    return {
        "name": name,
        "module": module,
        "Class": class_name,
        "title": title,
        "a_title": f"{article} {title}",
        "A_title": f"{article.capitalize()} {title}",
        "bus": bus.value,
        "wire": wire.title,
        "library": wire.library,
        "extra": wire.extra,
        "read": "read_input_registers" if modbus else "read",
        "write": write,
        "link_import": "from arcor2_hw.objects.modbus_link import ModbusLink\n" if modbus else "",
        "own_link_import": "" if modbus else "\nfrom .link import Link\n",
        "link_make": f"ModbusLink(name, {made}, request_timeout=0.25)" if modbus else f"Link(name, {made})",
        "settings_class": settings,
        "build": made_in_test,
        "orphan": orphan,
        "absent": wire.absent,
        "rest_value": str(kind.rest_value),
        "observe": kind.observe,
        "ask": kind.ask,
        "command": Template(kind.command).substitute(write=write),
        "run_long": kind.run_long,
        "own_test": kind.own_test,
        "imports": _imports(base),
        "stdlib": "".join(f"import {each}\n" for each in stdlib) + ("\n" if stdlib else ""),
        "link_arguments": ", ".join(f"{field}: {kind_of}" for field, kind_of, _, _ in wire.fields),
        "link_address": "{host}:{port}" if bus is Bus.TCP else "{port}",
        "link_port": 'f"socket://{host}:{port}"' if bus is Bus.TCP else "port, baud_rate",
        "settings_import": f"from arcor2_hw.objects.settings import {', '.join(imported)}\n",
        "typing_import": "from typing import Annotated\n" if serial else "",
        "actions": kind.actions,
        "on_loss": kind.on_loss,
        "loss_case": "test_loss_reaction" if kind.run_long else "test_control_does_not_come_back",
        "loss_sentence": "it stops if it receives nothing from the driver for 0.5 s.",
        "not_run": not_run,
        "settings_table": "\n".join(
            ["| setting | default | meaning |", "|---|---|---|"]
            + [f"| `{n}` | {d or '–'} | {text} |" for n, _, d, text in wire.fields]
        ),
        "map": f"Read: {kind.words}. Written: register 0, {kind.writes}.",
        "does": kind.does,
        "cell_settings": "\n".join(cell),
    }


def _imports(base: Base) -> str:
    lines = [
        "import pytest",
        "from arcor2_hw.testing.conformance import Conformance",
        "from arcor2_hw.testing.fake_bench import FakeBench",
    ]
    if base is Base.MACHINE:
        lines += [
            "from arcor2_hw.exceptions import Refused",
            "from arcor2_hw.objects import MachineCommand, MachineState",
        ]
    return "".join(
        f"{line}\n" for line in sorted(lines, key=lambda line: (line.split()[0] != "import", line.split()[1]))
    )


def _orphan(module: str, class_name: str, build: list[str], run_long: str) -> str:
    lines = "\n".join(build).replace('"', "'")
    return f'''ORPHAN = """
import sys
from {module}.{module} import {class_name}, {class_name}Settings
address = sys.argv[1]
{lines}
device = {class_name}('id', '{module}', settings)
device.connect()
device.take_control()
device.{run_long}
"""

'''


def _not_run() -> str:
    cases = ("nothing_resumes", "loss_reaction", "stop_passes", "one_act_at_a_time", "disconnecting_ends_an_act")
    return "\n".join(["not_run:", *(f"  {case}: {NO_ACT}" for case in cases)])
