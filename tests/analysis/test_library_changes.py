"""A library forgets exactly the analyses that a change of its sources makes outdated."""

from collections.abc import Mapping
from pathlib import Path
from unittest import mock

from hypothesis import given, settings, strategies as st

from arcor2_hw.analysis import Library, SourceFile
from arcor2_hw.exceptions import InvalidData

IMPORT = "from arcor2_hw.actions import ActionMetadata\n"
BASE = f"{IMPORT}from arcor2_hw.objects import Generic\n"


def action(name: str) -> str:
    return f"    def {name}(self) -> None: ...\n    {name}.__action__ = ActionMetadata()\n"


SOURCES: Mapping[str, tuple[str, ...]] = {
    "Press": (
        f"{BASE}class Press(Generic):\n{action('close')}",
        f"{BASE}class Press(Generic):\n{action('open')}",
        "class Press:\n    pass\n",
        "class Press(:\n",
    ),
    "HotPress": (
        f"{IMPORT}from .press import Press\nclass HotPress(Press):\n{action('heat')}",
        "from object_types import press\nclass HotPress(press.Press):\n    pass\n",
        "import object_types\nclass HotPress(object_types.press.Press):\n    pass\n",
        "from .press import *\nfrom .limits import *\nclass HotPress(Press):\n    pass\n",
    ),
    "Limits": ("class Limits:\n    pass\nRANGE = (1, 2)\n", "class Limits:\n    '''Of a press.'''\n"),
    "Gauge": (
        f"{BASE}from .limits import Limits\nclass Gauge(Limits, Generic):\n    pass\n",
        f"{BASE}from . import limits\nclass Gauge(limits.Limits, Generic):\n    pass\n",
        f"{BASE}try:\n    from .limits import Limits\nexcept ImportError:\n    Limits = object\n"
        "class Gauge(Limits, Generic):\n    pass\n",
        f"{BASE}class Gauge(Generic):\n    pass\n",
    ),
    "Line": (
        f"{IMPORT}from .hot_press import HotPress\nclass Line(HotPress):\n{action('run')}",
        "from .gauge import Gauge\nclass Line(Gauge):\n    pass\n",
    ),
    "Kit": (
        f"{BASE}from .part import PART\nfrom .limits import Limits\nclass Kit(Limits, Generic):\n    pass\n",
        f"{BASE}from . import gauge, part\nclass Kit(gauge.Gauge):\n    pass\n",
    ),
}
"""Sources of types that need each other, by the name of the type."""
CHANGES = st.one_of(*[st.tuples(st.just(name), st.sampled_from([*sources, None])) for name, sources in SOURCES.items()])
"""A type with its new source, or without one if it is removed."""


def source(name: str, text: str) -> SourceFile:
    module = {"HotPress": "hot_press"}.get(name, name.lower())
    file = SourceFile(name, module, text)
    return file.with_modules({"part": SourceFile("", "part", "PART = 1\n")}) if name == "Kit" else file


@settings(max_examples=60)
@given(st.lists(CHANGES, min_size=2, max_size=8))
def test_a_changed_library_equals_a_new_one(changes: list[tuple[str, str | None]]) -> None:
    library, texts = Library(), dict[str, str]()
    for name, text in changes:
        if text is not None:
            library.add(source(name, text))
            texts[name] = text
        elif texts.pop(name, None) is not None:
            library.remove(name)
        new = Library([source(each, text) for each, text in texts.items()])
        for each in new.names():
            assert library.analyse(each) == new.analyse(each), each


def test_unrelated_types_are_not_analysed_again() -> None:
    library = Library([source(name, texts[0]) for name, texts in SOURCES.items()])
    for name in library.names():
        library.analyse(name)
    with mock.patch.object(Library, "_analyse", autospec=True, side_effect=Library._analyse) as analyse:
        library.add(source("Press", SOURCES["Press"][1]))
        for name in library.names():
            library.analyse(name)
        assert sorted(call.args[1] for call in analyse.call_args_list) == ["HotPress", "Line", "Press"]


def test_a_changed_file_of_a_distribution_is_read_again(tmp_path: Path) -> None:
    package = tmp_path / "plant"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "base.py").write_text(f"{BASE}class Base(Generic):\n{action('first')}")
    text = "from plant.base import Base\nclass Mill(Base):\n    pass\n"
    (package / "mill.py").write_text(text)
    library = Library([SourceFile("Mill", "plant.mill", text, str(package / "mill.py"))])
    assert [action.name for action in library.analyse("Mill").actions] == ["first"]
    (package / "base.py").write_text(f"{BASE}class Base(Generic):\n{action('second')}    x = 1\n")
    library.add(source("Press", SOURCES["Press"][0]))
    assert [action.name for action in library.analyse("Mill").actions] == ["second"]


def test_a_type_that_cannot_be_added_changes_nothing() -> None:
    library = Library([source("Press", SOURCES["Press"][0])])
    before = library.analyse("Press")
    try:
        library.add(source("Robot", "class Robot:\n    pass\n"))
    except InvalidData:
        assert library.analyse("Press") is before
    else:
        raise AssertionError("a built-in name was accepted")
