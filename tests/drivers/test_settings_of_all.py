"""No setting of any driver makes the cell host open a file or URL that a user chose."""

import dataclasses
import importlib.metadata
import re
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.data.device import DEVICE_FILES
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.runtime.creation import ENTRY_POINTS, settings_type

VALID: dict[str, dict[str, Any]] = {
    "BarcodeReader": {"port": "/dev/ttyUSB0"},
    "Bin": {"length": 0.3, "width": 0.2, "height": 0.1, "part_mesh": "part.stl"},
    "Blister": {"rows": 2, "columns": 2, "row_pitch": 0.03, "column_pitch": 0.03, "state_file": "state.json"},
    "Conveyor": {"channel": "/dev/ttyACM0"},
    "DobotMagician": {"port": "/dev/ttyUSB0"},
    "ErpService": {"url": "https://erp.example", "token_file": "erp.example/t", "outbox": "outbox", "ca_file": "ca"}
    | {"client_certificate": "c", "client_key": "k"},
    "FunctionalTester": {"host": "10.0.0.7"},
    "MtSicsScale": {"port": "/dev/ttyUSB0"},
    "OakD": {"address": "10.0.0.7"},
    "OpcUaPlc": {"url": "opc.tcp://plc.example", "points": "a=DI i=1", "user": "u", "password_file": "plc.example/p"}
    | {"security": "basic256sha256_sign", "client_certificate": "c", "client_key": "k", "server_certificate": "s"},
    "OpenProtocolScrewdriver": {"host": "10.0.0.7"},
    "RemoteIO": {"serial_port": "/dev/ttyUSB0", "points": "a=DI0"},
    "Robotiq2F": {"wire": "modbus_rtu", "serial_port": "/dev/ttyUSB0"},
    "TowerLight": {"serial_port": "/dev/ttyUSB0", "red": "DO0"},
    "TwoAxisRobot": {"port": "/dev/ttyUSB0"},
    "UR3e": {"host": "10.0.0.7"},
    "UR5e": {"host": "10.0.0.7"},
    "UR10e": {"host": "10.0.0.7"},
    "YuMi": {"host": "10.0.0.7"},
    "ZplPrinter": {"port": "/dev/ttyUSB0"},
}
"""Settings of each type, with a value for every setting that names a port, a URL or a file."""
WRONG = {
    "port": ["spy:///dev/null?file=/tmp/x", "alt:///dev/null?class=x", "/etc/passwd"],
    "file": ["/data/tokens.json", "../tokens.json"],
    "url": ["file:///etc/passwd", "http://evil.example/?x"],
    "host": ["http://evil.example/"],
}


def kind_of(field: "dataclasses.Field[Any]") -> str | None:
    """Return the kind of a setting (port, URL or file), judged by its name; None for other settings."""
    if field.type not in ("str", str):
        return None
    for kind, names in (
        ("file", r"(^|_)(file|path|mesh|certificate|key|outbox|directory|folder)$"),
        ("url", r"(^|_)url$"),
        ("host", r"^(host|address)$"),
        ("port", r"(^|_)(port|channel|device)$"),
    ):
        if re.search(names, field.name):
            return kind
    return None


def cases() -> list[tuple[str, str, str]]:
    found = []
    for entry in importlib.metadata.entry_points(group=ENTRY_POINTS):
        if not entry.module.startswith("arcor2_drivers."):
            continue
        settings = settings_type(entry.load())
        for field in () if settings is None else dataclasses.fields(settings):
            if (kind := kind_of(field)) and field.name in VALID.get(entry.name, {field.name}):
                found += [(entry.name, field.name, wrong) for wrong in WRONG[kind]]
    return found


@pytest.mark.parametrize(("type_name", "setting", "wrong"), cases())
def test_files_and_urls_in_settings_are_checked(
    monkeypatch: pytest.MonkeyPatch, type_name: str, setting: str, wrong: str
) -> None:
    monkeypatch.setenv(DEVICE_FILES, "/data/device-files")
    (entry,) = importlib.metadata.entry_points(group=ENTRY_POINTS, name=type_name)
    settings: Any = settings_type(entry.load())
    settings(**VALID[type_name])
    with pytest.raises(OutOfRange, match=rf"^{setting} must be "):
        settings(**VALID[type_name] | {setting: wrong})


def test_a_port_setting_cannot_name_a_file(tmp_path: Path) -> None:
    (entry,) = importlib.metadata.entry_points(group=ENTRY_POINTS, name="MtSicsScale")
    settings: Any = settings_type(entry.load())
    tokens = tmp_path / "tokens.json"
    tokens.write_text("[]")
    with pytest.raises(OutOfRange, match=r"^port must be "):
        entry.load()("id", "scale", settings(f"spy:///dev/null?file={tokens}")).connect(timeout=0.2)
    assert tokens.read_text() == "[]"
