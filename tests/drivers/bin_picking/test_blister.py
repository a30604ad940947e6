"""A blister: parts and places in order, in its own frame; the state survives a restart on request."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arcor2_drivers.bin_picking.blister import Blister
from arcor2_drivers.bin_picking.errors import Empty, NoFreePlace
from arcor2_drivers.bin_picking.settings import BlisterSettings
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import NotConnected, OutOfRange

TRAY = Pose(Position(0.4, 0.1, 0.05), Orientation(0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)))  # turned by 90°


@pytest.fixture
def make() -> Iterator[Callable[..., Blister]]:
    made: list[Blister] = []

    def build(rows: int = 2, columns: int = 3, **settings: Any) -> Blister:
        given = BlisterSettings(
            rows, columns, 0.04, 0.03, **{"origin_x": 0.01, "origin_y": 0.02, "origin_z": 0.005, **settings}
        )
        found = Blister("tray_id", "tray", TRAY, given)
        made.append(found)
        found.connect()
        return found

    yield build
    for each in made:
        each.disconnect()


def local(pose: Pose) -> tuple[float, ...]:
    return tuple(round(each, 9) for each in (TRAY.inverted() * pose).position)


def test_parts_are_returned_in_order_until_taken(make: Callable[..., Blister]) -> None:
    tray = make()
    places = []
    while not tray.is_empty():
        assert tray.next_part() == tray.next_part()  # it was not gripped: the same part is returned again
        places.append(local(tray.next_part()))
        tray.part_taken()
    assert places == [(x, y, 0.005) for y in (0.02, 0.06) for x in (0.01, 0.04, 0.07)]
    with pytest.raises(Empty, match=r"^tray is empty\. Fill it, then call refill") as empty:
        tray.next_part()
    assert empty.value.code == "empty"
    with pytest.raises(Empty, match="part_taken needs a call of next_part"):
        tray.part_taken()
    tray.refill()
    assert (tray.parts(), tray.is_full()) == (6, True)
    assert tray.next_part().position.distance_to((TRAY * Pose(Position(0.01, 0.02, 0.005))).position) < 1e-12


def test_places_are_filled_in_serpentine_order(make: Callable[..., Blister]) -> None:
    tray = make(snake=True, starts_full=False, turn=90.0)
    columns = []
    while not tray.is_full():
        pose = tray.next_free()
        columns.append(round((local(pose)[0] - 0.01) / 0.03))
        tray.part_put()
    assert columns == [0, 1, 2, 2, 1, 0]
    assert (TRAY.inverted() * pose).orientation.angle_to(
        Orientation(0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4))
    ) == pytest.approx(0.0, abs=1e-6)
    with pytest.raises(NoFreePlace, match=r"^tray is full\. Empty it, then call clear"):
        tray.next_free()
    with pytest.raises(NoFreePlace, match="part_put needs a call of next_free"):
        tray.part_put()
    tray.clear()
    assert tray.parts() == 0


def test_single_places_and_the_tool(make: Callable[..., Blister]) -> None:
    tray = make()
    tray.set_place(0, 0, False)
    assert tray.parts() == 5
    assert local(tray.next_part()) == (0.04, 0.02, 0.005)
    assert local(tray.place(1, 2)) == (0.07, 0.06, 0.005)
    for row, column in ((2, 0), (0, 3), (-1, 0)):
        with pytest.raises(OutOfRange, match=r"^tray: row -?\d, column \d is outside of"):
            tray.place(row, column)
        with pytest.raises(OutOfRange, match=r"^tray: row -?\d, column \d is outside of"):
            tray.set_place(row, column, True)
    tool = tray.grip_pose(tray.place(0, 0), 0.1)
    assert local(tool) == (0.01, 0.02, 0.105)
    assert tool.orientation.matrix()[:, 2] == pytest.approx([0.0, 0.0, -1.0], abs=1e-9)
    tray.set_pose(TRAY * Pose(Position(0.5, 0.0, 0.0)))
    assert local(tray.place(0, 0)) == (0.51, 0.02, 0.005)


def test_the_state_is_restored_only_from_a_file(make: Callable[..., Blister], tmp_path: Path) -> None:
    tray = make()
    tray.next_part()
    tray.part_taken()
    tray.disconnect()
    assert make().parts() == 6
    file = tmp_path / "tray.json"
    kept = make(state_file=str(file))
    for _ in range(4):
        kept.next_part()
        kept.part_taken()
    del kept  # not closed, as if its process was killed
    again = make(state_file=str(file))
    assert again.parts() == 2
    assert local(again.next_part()) == (0.04, 0.06, 0.005)
    assert [each.name for each in tmp_path.iterdir()] == ["tray.json"]


def test_a_state_that_cannot_be_stored_is_reported(make: Callable[..., Blister], tmp_path: Path) -> None:
    folder = tmp_path / "there"
    folder.mkdir()
    tray = make(state_file=str(folder / "tray.json"))
    tray.next_part()
    (folder / "tray.json").unlink()
    folder.rmdir()
    with pytest.raises(NotConnected, match=r"^tray: the state file cannot be written"):
        tray.part_taken()
    assert tray.parts() == 6
    with pytest.raises(NotConnected, match=r"^tray: the state file cannot be used"):
        make(state_file=str(tmp_path / "nowhere" / "tray.json"))
    for text in (
        "{",
        "[]",
        '{"version":1,"rows":9,"columns":9,"full":""}',
        '{"version":1,"rows":2,"columns":3,"full":"1"}',
    ):
        (tmp_path / "bad.json").write_text(text)
        with pytest.raises(NotConnected, match=r"bad\.json"):
            make(state_file=str(tmp_path / "bad.json"))
        assert (tmp_path / "bad.json").read_text() == text  # so that a person can inspect it


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"rows": 0}, "rows"),
        ({"columns": 0}, "columns"),
        ({"rows": 200, "columns": 200}, "rows times columns"),
        ({"row_pitch": 0.0}, "row_pitch"),
        ({"column_pitch": float("nan")}, "column_pitch"),
        ({"origin_z": 10.0}, "origin_z"),
        ({"turn": 1000.0}, "turn"),
    ],
)
def test_settings_are_checked(wrong: dict[str, Any], named: str) -> None:
    right = {"rows": 2, "columns": 3, "row_pitch": 0.04, "column_pitch": 0.03}
    with pytest.raises(OutOfRange, match=f"^{named} must be"):
        BlisterSettings(**{**right, **wrong})
