"""The object types of the workplace as code: two uploaded, one of a driver with its own folder, one of this library."""

from pathlib import Path

import pytest

import arcor2_hw.objects
from arcor2_server.object_types.catalog import PackageType
from tests.server.build import workplace

STOCK = Path(arcor2_hw.objects.__file__).parent / "stock"


def make_code(directory: Path) -> list[PackageType]:
    """Write the driver below a directory and return all types."""
    folder = directory / "vendor" / "acme_devices" / "acme_reader"
    for name, content in workplace.DRIVER.items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(content)
    reader = "acme_devices.acme_reader.reader:AcmeReader"
    flow = "arcor2_hw.objects.stock.flow_actions:FlowActions"
    return [
        PackageType("Arm", "arm", workplace.ARM),
        PackageType("AcmeReader", "acme_reader", "", reader, folder, "acme-devices", "2.1"),
        PackageType("FlowActions", "flow_actions", "", flow, STOCK, "arcor2-hw", "0.1.0"),
        PackageType("table", "table", workplace.TABLE),
    ]


@pytest.fixture
def code(tmp_path: Path) -> list[PackageType]:
    return make_code(tmp_path)


@pytest.fixture
def driver(code: list[PackageType]) -> PackageType:
    return code[1]
