"""The object types of the workplace as code: two uploaded, one of a driver with its own folder, one of this library."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import arcor2_hw.objects
from arcor2_server.object_types.catalog import PackageType
from tests.server.build import workplace

STOCK = Path(arcor2_hw.objects.__file__).parent / "stock"
ROOT = Path(__file__).parents[3]

Mypy = Callable[[Path], list[str]]


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


@pytest.fixture
def mypy(pytestconfig: pytest.Config) -> Mypy:
    """Return a function that runs mypy on a package and its module `wrong`, and returns the lines of the output."""
    assert pytestconfig.cache is not None
    cache = pytestconfig.cache.mkdir("mypy_packages")

    def check(package: Path) -> list[str]:
        done = subprocess.run(
            [
                *(sys.executable, "-m", "mypy", "--strict", "--config-file=", "--no-error-summary"),
                *("--cache-dir", str(cache), "--explicit-package-bases"),
                *("script.py", "action_points.py", "object_types", "wrong.py"),
            ],
            cwd=package,
            env={**os.environ, "MYPYPATH": f"{package}:{ROOT}"},
            capture_output=True,
            text=True,
            timeout=110,
        )
        assert not done.stderr, done.stderr
        return done.stdout.splitlines()

    return check
