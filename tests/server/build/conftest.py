"""The workplace's object types as code: two uploaded, one of a driver with a folder of its own, one of ours."""

from pathlib import Path

import pytest

import arcor2_hw.objects
from arcor2_server.object_types import PackageType
from tests.server.build import workplace

STOCK = Path(arcor2_hw.objects.__file__).parent / "stock"


@pytest.fixture
def driver(tmp_path: Path) -> PackageType:
    folder = tmp_path / "vendor" / "acme_devices" / "acme_reader"
    for name, content in workplace.DRIVER.items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(content)
    entry = "acme_devices.acme_reader.reader:AcmeReader"
    return PackageType("AcmeReader", "acme_reader", "", entry, folder, "acme-devices", "2.1")


@pytest.fixture
def code(driver: PackageType) -> list[PackageType]:
    entry = "arcor2_hw.objects.stock.flow_actions:FlowActions"
    return [
        PackageType("Arm", "arm", workplace.ARM),
        driver,
        PackageType("FlowActions", "flow_actions", "", entry, STOCK, "arcor2-hw", "0.1.0"),
        PackageType("table", "table", workplace.TABLE),
    ]
