"""The cell layout: its content, and errors of invalid layouts."""

import copy
import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from transforms3d.affines import compose
from transforms3d.euler import euler2mat

import arcor2_fakes.cell
from arcor2_fakes.cell.layout import LayoutError, Place, Pose, Tolerance, read_layout

EXAMPLE = Path(arcor2_fakes.cell.__file__).with_name("example.json")


def test_the_example_can_be_read() -> None:
    layout = read_layout(EXAMPLE)
    assert layout.feeder.refill_time == 0.3
    assert layout.tester.tolerance.turn == 0.1
    assert layout.good_box.tolerance.turn is None


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (lambda layout: layout.pop("feeder"), "feeder"),
        (lambda layout: layout.update(fedeer={}), "fedeer"),
        (lambda layout: layout["gripper"].update(output=18), r"gripper.output"),
        (lambda layout: layout["tester"]["tolerance"].update(position=0.0), r"tester.tolerance.position"),
        (lambda layout: layout["tester"]["tolerance"].update(tilt=4.0), r"tester.tolerance.tilt"),
        (lambda layout: layout["reader"]["pose"].update(position=[1.0, 2.0]), r"reader.pose.position"),
        (lambda layout: layout["reader"]["pose"].update(orientation=[0, 0, 0, 2]), "unit quaternion"),
    ],
)
def test_an_invalid_layout_names_the_field(change: Any, names: str, tmp_path: Path) -> None:
    layout = copy.deepcopy(msgspec.json.decode(EXAMPLE.read_bytes()))
    change(layout)
    path = tmp_path / "layout.json"
    path.write_bytes(msgspec.json.encode(layout))
    with pytest.raises(LayoutError, match=names) as caught:
        read_layout(path)
    assert str(path) in str(caught.value)


def test_missing_files_and_invalid_json_are_refused(tmp_path: Path) -> None:
    with pytest.raises(LayoutError, match="No such file"):
        read_layout(tmp_path / "none.json")
    (tmp_path / "bad.json").write_text('{"robot": ')
    with pytest.raises(LayoutError, match=r"bad\.json"):
        read_layout(tmp_path / "bad.json")


QUARTER = math.sqrt(0.5)


@pytest.mark.parametrize(
    ("offset", "roll", "yaw", "there"),
    [
        ((0.0, 0.0, 0.0), 0.0, 0.0, True),
        ((0.009, 0.0, 0.0), 0.0, 0.0, True),
        ((0.008, 0.008, 0.0), 0.0, 0.0, False),
        ((0.0, 0.0, 0.049), 0.0, 0.0, True),
        ((0.0, 0.0, 0.051), 0.0, 0.0, False),
        ((0.0, 0.0, -0.009), 0.0, 0.0, True),
        ((0.0, 0.0, -0.02), 0.0, 0.0, False),
        ((0.0, 0.0, 0.0), 0.19, 0.0, True),
        ((0.0, 0.0, 0.0), -0.21, 0.0, False),
        ((0.0, 0.0, 0.0), math.pi, 0.0, False),
        ((0.0, 0.0, 0.0), 0.0, -0.29, True),
        ((0.0, 0.0, 0.0), 0.0, 0.31, False),
    ],
)
def test_tolerances_are_along_the_axes_of_the_place(
    offset: tuple[float, float, float], roll: float, yaw: float, there: bool
) -> None:
    # A place on a wall: its z axis is the x axis of the world.
    place = Place(Pose((1.0, 2.0, 3.0), (0.0, QUARTER, 0.0, QUARTER)), Tolerance(0.01, 0.05, 0.2, 0.3))
    board = place.pose.matrix() @ compose(offset, euler2mat(roll, 0.0, yaw), np.ones(3))
    assert place.holds(board) is there
    if there and offset[2] > 0:
        assert board[0, 3] == pytest.approx(1.0 + offset[2])
