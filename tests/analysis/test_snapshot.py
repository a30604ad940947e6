"""A stored analysis is used until one of its sources changes."""

import ast
from collections.abc import Callable
from pathlib import Path

import pytest

from arcor2_hw.analysis import Library, SourceFile, installed_types, snapshot

NEIGHBOURS = {
    "vendor/__init__.py": "",
    "vendor/limits.py": "TOP = 0.25\n",
    "vendor/arm.py": """
from arcor2_hw.actions import action
from arcor2_hw.objects import Generic
from vendor.limits import TOP
try:
    from vendor.extra import EXTRA
except ImportError:
    EXTRA = 0

class Arm(Generic):
    _ABSTRACT = False

    @action
    def move(self, speed: float = TOP, *, an: str | None = None) -> None: ...
""",
}


@pytest.fixture
def vendor(tmp_path: Path) -> Path:
    for name, text in NEIGHBOURS.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path / "vendor"


def library(vendor: Path) -> Library:
    arm = vendor / "arm.py"
    return Library([SourceFile("Arm", "vendor.arm", arm.read_bytes(), str(arm))])


def test_all_installed_types_are_restored_without_parsing_in_any_order(monkeypatch: pytest.MonkeyPatch) -> None:
    files = [each.file for each in installed_types() if each.file is not None]
    first, second = Library(files), Library(reversed(files))
    stored = snapshot.take(first)
    with monkeypatch.context() as patches:
        patches.setattr(ast, "parse", None)
        restored = snapshot.restore(second, stored)
        found = {name: second.analyse(name) for name in first.names()} if restored else {}
    assert found == {name: first.analyse(name) for name in first.names()}


CHANGES: dict[str, Callable[[Path], object]] = {
    "source of the type": lambda vendor: (vendor / "arm.py").write_text(NEIGHBOURS["vendor/arm.py"] + "\n"),
    "imported module": lambda vendor: (vendor / "limits.py").write_text("TOP = 0.125\n"),
    "module that was missing": lambda vendor: (vendor / "extra.py").write_text("EXTRA = 1\n"),
    "removed module": lambda vendor: (vendor / "limits.py").unlink(),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_change_of_any_file_invalidates_the_snapshot(vendor: Path, change: Callable[[Path], object]) -> None:
    stored = snapshot.take(library(vendor))
    assert snapshot.restore(library(vendor), stored)
    change(vendor)
    assert not snapshot.restore(library(vendor), stored)


def test_an_added_source_invalidates_the_snapshot(vendor: Path) -> None:
    stored = snapshot.take(library(vendor))
    more = library(vendor)
    more.add(SourceFile("Late", "late", "class Late: ...\n"))
    assert not snapshot.restore(more, stored)


def test_damaged_bytes_are_refused(vendor: Path) -> None:
    stored = snapshot.take(library(vendor))
    for damaged in (b"", b"\xff" * 8, stored[: len(stored) // 2], stored[:-1]):
        fresh = library(vendor)
        assert not snapshot.restore(fresh, damaged)
        assert [parameter.name for parameter in fresh.analyse("Arm").actions[0].parameters] == ["speed"]


def test_text_and_bytes_are_not_confused() -> None:
    source = "from object_types.helper import VALUE\nfrom arcor2_hw.objects import Generic\nclass A(Generic): ...\n"
    files = [SourceFile("A", "a", source.encode()), SourceFile("Helper", "helper", "VALUE = 1\nclass Helper: ...\n")]
    first, second = Library(files), Library(files)
    assert snapshot.restore(second, snapshot.take(first))
    assert [file.source for file in second.analyse("A").modules] == ["VALUE = 1\nclass Helper: ...\n"]
