"""Category, icon and unit in the editor come from the class and its docstrings."""

import json

import pytest

from arcor2_hw.analysis import Library, SourceFile, installed_types
from arcor2_hw.analysis.units import unit_in
from arcor2_hw.data.base import UNSET

TYPE = '''
from dataclasses import dataclass

from arcor2_hw.actions import action
from arcor2_hw.objects import Generic, Robot, Settings

HEADING = "Heat"


@dataclass
class OvenSettings(Settings):
    """Settings.

    :param volume: how much fits in, l
    :param name: text, m
    """

    volume: float = 1.0
    name: str = ""


class Oven(Generic):
    _ABSTRACT = False
    display_name = "Oven 3000"
    category = HEADING
    icon = "oven"

    def __init__(self, obj_id: str, name: str, settings: OvenSettings) -> None:
        super().__init__(obj_id, name, settings)

    @action
    def heat(self, power: float, seconds: int, label: str, *, an: str | None = None) -> None:
        """Heat.

        :param power: how much [W]
        :param seconds: how long, s
        :param label: how far, m
        """
        assert 0.0 <= power <= 900.0

    @action(verdict=True, again="safe")
    def done(self, *, an: str | None = None) -> bool:
        """Return whether it is done."""

    @action(category="Door", icon="door-open")
    def open(self, *, an: str | None = None) -> None:
        """Open."""

    @action(icon="Door Open")
    def close(self, *, an: str | None = None) -> None:
        """Close."""


class GrillOven(Oven):
    icon = "grill"
'''
OLDER = """
from arcor2.data.common import ActionMetadata
from arcor2_object_types.abstract import Robot


class Old(Robot):
    _ABSTRACT = False
    icon = object()

    @property
    def category(self):
        return 5

    def go(self, *, an: str | None = None) -> None:
        pass

    go.__action__ = ActionMetadata()
"""


@pytest.fixture(scope="module")
def library() -> Library:
    return Library(
        [SourceFile(name, "oven", TYPE) for name in ("Oven", "GrillOven")] + [SourceFile("Old", "old", OLDER)]
    )


def test_category_and_icon_come_from_the_class(library: Library) -> None:
    oven, grill = library.analyse("Oven"), library.analyse("GrillOven")
    assert (oven.meta.category, oven.meta.icon) == ("Heat", "oven")
    assert (oven.meta.display_name, grill.meta.display_name) == ("Oven 3000", UNSET)
    assert (grill.meta.category, grill.meta.icon) == ("Heat", "grill")
    shown = {action.name: (action.category, action.icon) for action in grill.actions}
    assert shown == {
        "heat": ("Heat", "grill"),
        "done": ("Heat", "grill"),
        "open": ("Door", "door-open"),
        "close": (UNSET, UNSET),
    }
    assert {action.name for action in oven.actions if action.meta.verdict is True} == {"done"}
    assert {action.name: action.meta.again for action in oven.actions if action.meta.again} == {"done": "safe"}
    (close,) = [action for action in oven.actions if action.name == "close"]
    assert close.disabled
    assert "'Door Open' is not a valid icon" in str(close.problem)
    robot = library.analyse("Robot").meta
    assert (robot.category, robot.icon) == ("Robots", "robot")


def test_older_types_may_use_these_names_for_other_attributes(library: Library) -> None:
    old = library.analyse("Old")
    assert old.problem is None
    assert (old.meta.category, old.meta.icon) == (UNSET, UNSET)
    assert not old.actions[0].disabled


def test_numbers_carry_their_unit(library: Library) -> None:
    oven = library.analyse("Oven")
    (heat,) = [action for action in oven.actions if action.name == "heat"]
    power, seconds, label = heat.parameters
    assert json.loads(str(power.extra)) == {"minimum": 0.0, "maximum": 900.0, "unit": "W"}
    assert json.loads(str(seconds.extra)) == {"unit": "s"}
    assert label.extra is UNSET
    volume, name = oven.meta.settings
    assert json.loads(str(volume.extra)) == {"unit": "l"}
    assert name.extra is UNSET


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("how fast [m/s]", "m/s"),
        ("how fast (mm/s), at most", "mm/s"),
        ("how fast, m/s", "m/s"),
        ("what speed 1 means, m/s²", "m/s²"),
        ("height in the arm's base that a jump does not rise above, m", "m"),
        ("how far the tool is before the wrist, m; 0.0597 for the suction cup", "m"),
        ("how far, mm. Never less than 3, kg", "mm"),
        ("m/s, negative backwards, 0 stops it", "m/s"),
        ("seconds after which it fails", "s"),
        ("Seconds to look for one", "s"),
        ("ms without a request", "ms"),
        ("Percent.", "%"),
        ("torque, N m", "N m"),
        ("inertia [kg·m²]", "kg·m²"),
        ("stiffness, N/m", "N/m"),
        ("rate, 1/min", "1/min"),
        ("share of the stroke, %", "%"),
        ("kg", "kg"),
        ("N; more is not taken", "N"),
        ("m, negative for backwards", "m"),
        ("m from its zero", "m"),
        ("m between the fingers", "m"),
        ("", None),
        ("m and more", None),
        ("whether it holds", None),
        ("which lamp: a, b or c", None),
        ("1, 2 or 3", None),
        ("A, B or C", None),
        ("the part(s) to take", None),
        ("number of parts [optional]", None),
        ("pulses per metre of the belt", None),
        ("metres per second", None),
        ("bits per second", None),
        ("fraction of the configured maximum", None),
        ("stepper port of the belt, 0 or 1; -1: there is none", None),
        ("how far, more or less", None),
        ("in m", None),
    ],
)
def test_unit_is_read_from_the_description(text: str, unit: str | None) -> None:
    assert unit_in(text) == unit


def test_every_installed_type_has_a_heading_and_units() -> None:
    installed = installed_types()
    library = Library(each.file for each in installed if each.file is not None)
    metas = [library.analyse(each.name).meta for each in installed]
    assert [meta.type for meta in metas if UNSET in (meta.display_name, meta.category, meta.icon)] == []
    assert {meta.type: meta.shown_name for meta in metas}["OakD"] == "Luxonis OAK-D"
    dobot = next(meta for meta in metas if meta.type == "DobotMagician")
    units = {s.name: json.loads(str(s.extra)).get("unit") for s in dobot.settings if s.extra is not UNSET}
    assert units["max_tcp_speed"] == "m/s"
    assert units["joint_acceleration"] == "rad/s²"
    assert "conveyor_port" not in units
