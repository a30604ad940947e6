"""Tests that the files and folders on the architecture page exist, and that it names every package."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "explanation" / "architecture.md").read_text()
SERVER = ROOT / "server" / "arcor2_server"


def test_every_named_path_exists() -> None:
    paths = re.findall(r"`((?:arcor2_hw|drivers|fakes|server|editor|docs|benchmarks)(?:/[\w.-]+)+)`", PAGE)
    assert len(paths) > 40
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_every_package_of_the_server_is_in_a_layer() -> None:
    section = PAGE.partition("## Layers of the server")[2].partition("\n## ")[0]
    named = set(re.findall(r"`(\w+)`", section))
    packages = {path.parent.name for path in SERVER.glob("*/__init__.py")}
    assert packages - named == set()


def test_every_package_of_the_library_is_described() -> None:
    section = PAGE.partition("## Packages")[2].partition("\n## ")[0]
    packages = {path.parent.name for path in (ROOT / "arcor2_hw").glob("*/__init__.py")}
    assert packages == set(re.findall(r"`arcor2_hw/(\w+)`", section))
