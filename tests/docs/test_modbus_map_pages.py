"""The pages about maps of Modbus devices match the examples and the keys that are read."""

import re
from pathlib import Path

import pytest

from arcor2_hw.data.modbus_point import FORMATS, Point
from arcor2_server.cli import device_map

DOCS = Path(__file__).parents[2] / "docs"
HOW_TO = (DOCS / "how-to" / "modbus-device-from-a-map.md").read_text()
REFERENCE = (DOCS / "reference" / "modbus-map.md").read_text()


def section(title: str) -> str:
    found = re.search(rf"^## {title}$(.*?)(?=^## |\Z)", REFERENCE, re.MULTILINE | re.DOTALL)
    assert found is not None, title
    return found[1]


def keys(title: str) -> set[str]:
    """Return the keys in the first column of the table of a section."""
    rows = re.findall(r"^\| ([^|]*`[^|]*) \|", section(title), re.MULTILINE)
    return {key for row in rows for key in re.findall(r"`(\w+)`", row)}


@pytest.mark.parametrize(
    ("title", "kind"),
    [
        ("Device", device_map.DeviceMap),
        ("Points", Point),
        ("Commands", device_map.Command),
        ("Control", device_map.Control),
        ("Faults", device_map.Fault),
    ],
)
def test_all_keys_are_described(title: str, kind: type) -> None:
    assert keys(title) == set(kind.__struct_fields__)  # type: ignore[attr-defined]


def test_all_types_of_numbers_are_described() -> None:
    assert set(re.findall(r"`((?:u?int|float)\d+)`", section("Points"))) == set(FORMATS)


def test_the_how_to_shows_the_example() -> None:
    shown = re.search(r'```yaml title="dispenser.yaml"\n(.*?)```', HOW_TO, re.DOTALL)
    assert shown is not None
    assert shown[1] == (DOCS / "examples" / "dispenser.yaml").read_text()


def test_the_table_of_the_screwdriver_matches_its_map() -> None:
    points = device_map.read_map(DOCS / "examples" / "screwdriver.yaml").points
    rows = re.findall(
        r"^\| ([\w, ]+) \| (input register|holding register|discrete input|coil)s? ([\d, ]+) \|", HOW_TO, re.M
    )
    table = {(kind.replace(" ", "_"), int(address)) for _, kind, addresses in rows for address in addresses.split(",")}
    used = {
        (point.table, address)
        for point in points.values()
        for address in range(point.address, point.address + point.size)
    }
    assert table == used
