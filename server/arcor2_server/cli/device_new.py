"""`arcor2-hw device new`: create a driver, a fake, a test and a documentation page from templates."""

import enum
import keyword
import re
import sys
from importlib import resources
from pathlib import Path
from string import Template
from typing import Annotated, Final, NamedTuple

from cyclopts import Parameter

from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.starter_kinds import KINDS, Base

MAX_NAME: Final = 24
"""Maximum length of the name of a device."""
STARTER: Final = resources.files("arcor2_server.cli") / "starter"
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
        check: line of code that checks the settings.
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
        "Modbus TCP or RTU",
        "pymodbus 3.16",
        "[modbus]",
        (
            ("host", "str", "", "address or name of the device; empty for Modbus RTU"),
            ("port", "int", "502", "port of its Modbus server"),
            ("serial_port", "str", '""', "serial port, for Modbus RTU"),
            ("baudrate", "int", "19200", "bits per second on the serial line"),
            ("parity", "str", "none", "none, even or odd"),
            ("stopbits", "int", "1", "1 or 2"),
            ("unit_id", "int", "1", "Modbus unit id"),
            ("request_timeout", "float", "0.25", "time the device has to answer one request, s"),
        ),
        "**modbus_address(address)",
        "127.0.0.1:1",
        "",
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

MODBUS_IMPORTS: Final = """from arcor2_hw.objects.modbus_link import ModbusLink
from arcor2_hw.objects.modbus_settings import ModbusSettings
"""
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
    base: Annotated[Base | None, Parameter(help="Kind of device.")] = None,
    bus: Annotated[Bus | None, Parameter(help="Communication with the device.")] = None,
    from_map: Annotated[Path | None, Parameter(help="Map of a Modbus device, in place of --base and --bus.")] = None,
    directory: Annotated[Path, Parameter(help="Folder in which the new folder is created.")] = Path(),
) -> int:
    """Create a driver for a new device with a fake, a test and a page. It passes the conformance suite."""
    module = name.replace("-", "_")
    if not re.fullmatch(rf"[a-z][a-z0-9_]{{0,{MAX_NAME - 1}}}", module) or keyword.iskeyword(module):
        reason = f"invalid name {name!r}: use up to {MAX_NAME} lower-case letters, digits and _"
        return fail("device new", reason, ExitStatus.USAGE)
    if (from_map is None) is (base is None or bus is None) or (from_map and (base or bus)):
        return fail("device new", "give either --base and --bus, or --from-map", ExitStatus.USAGE)
    if base and bus and (reason := refusal(base, bus)):
        return fail("device new", f"{base} on {bus}: {reason}", ExitStatus.USAGE)
    root = directory / name
    try:
        files = texts(name, base, bus) if base and bus else texts_from_map(name, from_map or Path())
        if re.search(rf"^from .* import .*\b{_class_name(module)}\b", files[f"{module}/{module}.py"], re.MULTILINE):
            return fail("device new", f"a class of the library has the name of {name!r}: use another", ExitStatus.USAGE)
        root.mkdir(parents=True)
        for path, text in files.items():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(text, encoding="utf-8")
    except Arcor2Error as error:
        return fail("device new", str(error), ExitStatus.USAGE)
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
    words["settings_class"] = _fill("modbus_settings.txt" if bus is Bus.MODBUS else "settings.txt", words)
    words["own_test"] = _fill(f"test_{base}.py", words)
    words["long"] = _fill("long.txt", words) if KINDS[base].run_long else ""
    words["orphan"] = _fill("orphan.txt", words) if words["acts"] else ""
    own_hooks = _fill(f"hooks_{base}.txt", words) + (_fill("orphan_hook.txt", words) if words["acts"] else "")
    words["hooks"] = _fill("hooks.txt", words) + own_hooks
    found = _common(name, module, words) | {
        f"{module}/{module}.py": _fill(f"driver_{base}.py", words),
        f"{module}/{module}_fake.py": _fill(f"fake_{KINDS[base].fake}.py", words),
    }
    if bus is not Bus.MODBUS:
        found[f"{module}/link.py"] = _fill("link_http.py" if bus is Bus.HTTP else "link_text.py", words)
    return found


def texts_from_map(name: str, file: Path) -> dict[str, str]:
    """Return the files of a new device by path. Raises InvalidData, NotFound for the map."""
    from arcor2_server.cli import device_from_map, device_map

    module, device = name.replace("-", "_"), device_map.read_map(file)
    words = _words(name, module, Base.GENERIC, Bus.MODBUS)
    words |= device_from_map.words(words["Class"], device)
    words["orphan"] = _fill("orphan.txt", words) if words["acts"] else ""
    return _common(name, module, words) | {
        f"{module}/{module}.py": _fill("map_driver.py", words),
        f"{module}/{module}_fake.py": _fill("map_fake.py", words),
        f"{module}/map.yaml": file.read_text(encoding="utf-8"),
    }


def _common(name: str, module: str, words: dict[str, str]) -> dict[str, str]:
    """Return the files that all new devices have, by path."""
    return {
        f"{module}/__init__.py": f'"""{words["A_title"]}."""\n',
        f"{module}/quality.yaml": _fill("quality.yaml", words),
        f"tests/test_{module}.py": _fill("test.py", words),
        f"docs/{name}.md": _fill("page.md", words),
        "pyproject.toml": _fill("pyproject.toml", words),
        "cell.yaml": _fill("cell.yaml", words),
    }


def _fill(template: str, words: dict[str, str]) -> str:
    return Template((STARTER / f"{template}.tmpl").read_text(encoding="utf-8")).substitute(words)


def _class_name(module: str) -> str:
    return "".join(part.capitalize() for part in module.split("_"))


def _words(name: str, module: str, base: Base, bus: Bus) -> dict[str, str]:
    """Return the values of the placeholders in the templates."""
    kind, wire = KINDS[base], WIRES[bus]
    class_name = _class_name(module)
    title = module.replace("_", " ")
    article = "an" if title[0] in "aeiou" else "a"
    modbus = bus is Bus.MODBUS
    names = [field[0] for field in wire.fields]
    imported = sorted(set(re.findall(r"check_\w+", wire.check)))
    serial = bus is Bus.SERIAL
    acts = kind.acts or kind.run_long
    stdlib = (["sys"] if acts else []) + (["threading"] if base is Base.READER else [])
    if serial:
        imported.insert(0, "Range")
    made = ", ".join(f"settings.{field}" for field in names)
    fields = [f"    {n}: {RANGES.get(n, t)}" + (f" = {d}" if d else "") for n, t, d, _ in wire.fields]
    build = [
        *(['host, _, port = address.rpartition(":")'] if wire.address == HOST else []),
        f"settings = {class_name}Settings({wire.address})",
    ]
    made_in_test = "\n".join(f"    {line}" for line in [*build, f'return {class_name}("id", "{module}", settings)'])
    example = {"host": "192.168.0.7", "url": "http://192.168.0.7", "port": "/dev/ttyUSB0" if bus is Bus.SERIAL else ""}
    cell = [f"    {n}: {example.get(n) or d}" for n, _, d, _ in wire.fields[:2]]
    write = "write_registers" if modbus else "write"
    not_run = "\n".join(["not_run:", *(f"  {case}: {why}" for case, why in kind.not_run)]) if kind.not_run else ""
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
        "link_import": MODBUS_IMPORTS if modbus else "",
        "settings_base": "" if modbus else ", Settings",
        "own_link_import": "" if modbus else "\nfrom .link import Link\n",
        "link_make": "ModbusLink.of(name, settings)" if modbus else f"Link(name, {made})",
        "described": "\n".join(f"    :param {n}: {text}" for n, _, _, text in wire.fields),
        "fields": "\n".join(fields),
        "check": wire.check,
        "build": made_in_test,
        "orphan_build": "\n".join(build).replace('"', "'"),
        "absent": wire.absent,
        "rest_value": str(kind.rest_value),
        "observe": kind.observe,
        "ask": kind.ask,
        "command": Template(kind.command).substitute(write=write),
        "run_long": kind.run_long,
        "acts": acts,
        "imports": _imports(base, bus),
        "orphan_import": "from arcor2_hw.testing.fake_bench import modbus_address\n" if modbus else "",
        "stdlib": "".join(f"import {each}\n" for each in stdlib) + ("\n" if stdlib else ""),
        "link_arguments": ", ".join(f"{field}: {kind_of}" for field, kind_of, _, _ in wire.fields),
        "link_address": "{host}:{port}" if bus is Bus.TCP else "{port}",
        "link_port": 'f"socket://{host}:{port}"' if bus is Bus.TCP else "port, baud_rate",
        "settings_import": "" if modbus else f"from arcor2_hw.objects.settings import {', '.join(imported)}\n",
        "typing_import": "from typing import Annotated\n" if serial else "",
        "actions": kind.actions,
        "on_loss": kind.on_loss,
        "loss_case": "test_loss_reaction" if acts else "test_control_does_not_come_back",
        "loss_sentence": "it stops after 0.5 s.",
        "bench_data": "",
        "controller": "its own fake",
        "limits": "",
        "level": "silver",
        "not_run": not_run,
        "settings_table": "\n".join(
            ["| setting | default | meaning |", "|---|---|---|"]
            + [f"| `{n}` | {d or '–'} | {text} |" for n, _, d, text in wire.fields]
        ),
        "map": f"Read: {kind.words}. Written: register 0, {kind.writes}.",
        "does": kind.does,
        "cell_settings": "\n".join(cell),
    }


def _imports(base: Base, bus: Bus) -> str:
    lines = [
        "import pytest",
        "from arcor2_hw.testing.bench import Check",
        "from arcor2_hw.testing.conformance import Conformance",
        f"from arcor2_hw.testing.fake_bench import FakeBench{', modbus_address' if bus is Bus.MODBUS else ''}",
    ]
    if base is Base.MACHINE:
        lines += [
            "from arcor2_hw.exceptions import Refused",
            "from arcor2_hw.objects import MachineCommand, MachineState",
        ]
    if base is Base.READER:
        lines.append("from arcor2_hw.testing.life import BackgroundCall, wait_until")
    return "".join(
        f"{line}\n" for line in sorted(lines, key=lambda line: (line.split()[0] != "import", line.split()[1]))
    )
