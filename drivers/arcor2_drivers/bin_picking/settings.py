"""Settings of bin and blister, checked when they are given."""

import dataclasses
import math

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import device_file

LARGEST_PART = 1.0
"""m"""
MOST_PLACES = 10_000


def within(name: str, value: float, low: float, high: float) -> None:
    """Raise OutOfRange, naming the parameter, unless the value lies in the range."""
    if not (math.isfinite(value) and low <= value <= high):
        raise OutOfRange(f"{name} must be {low:g} to {high:g}, not {value!r}")


@dataclasses.dataclass
class BinSettings(Settings):
    """The crate, and the part that lies in it: a box, or a mesh.

    :param length: inside of the crate along x, m
    :param width: inside of the crate along y, m
    :param height: inside of the crate along z, m
    :param part_length: size of a part that is a box along its x, m; 0 for a mesh
    :param part_width: along its y, m
    :param part_height: along its z, m
    :param part_mesh: path of the part's mesh (STL, OBJ, PLY) in metres, instead of the sizes
    :param min_quality: 0 to 1, below which a part is not given
    :param tolerance: m by which a point may miss the part's surface: three times the camera's noise
    :param grip_depth: m below a part's top where it is gripped
    :param max_age: seconds after which a picture is too old
    """

    length: float
    width: float
    height: float
    part_length: float = 0.0
    part_width: float = 0.0
    part_height: float = 0.0
    part_mesh: str = ""
    min_quality: float = 0.9
    tolerance: float = 0.004
    grip_depth: float = 0.0
    max_age: float = 10.0

    def __post_init__(self) -> None:
        self.part_mesh = device_file("part_mesh", self.part_mesh)
        for name in ("length", "width", "height"):
            within(name, getattr(self, name), 0.02, 3.0)
        sizes = {name: getattr(self, name) for name in ("part_length", "part_width", "part_height")}
        if self.part_mesh:
            if any(sizes.values()):
                raise OutOfRange("part_mesh must be empty for a part that is a box")
        else:
            for name, size in sizes.items():
                within(name, size, 0.003, LARGEST_PART)
        within("min_quality", self.min_quality, 0.3, 1.0)
        within("tolerance", self.tolerance, 0.0005, 0.02)
        within("grip_depth", self.grip_depth, 0.0, LARGEST_PART)
        within("max_age", self.max_age, 0.1, 3600.0)


@dataclasses.dataclass
class BlisterSettings(Settings):
    """The grid of places.

    :param rows: places along y
    :param columns: places along x
    :param row_pitch: m from row to row
    :param column_pitch: m from column to column
    :param origin_x: where the first place is, relative to the blister's own pose, m
    :param origin_y: m
    :param origin_z: m
    :param turn: how parts are turned about z against the blister, degrees
    :param snake: whether every second row is counted backwards
    :param starts_full: whether all places have a part in the beginning
    :param state_file: path of a file in which the state is kept, so that it survives a restart; empty: it does not
    """

    rows: int
    columns: int
    row_pitch: float
    column_pitch: float
    origin_x: float = 0.0
    origin_y: float = 0.0
    origin_z: float = 0.0
    turn: float = 0.0
    snake: bool = False
    starts_full: bool = True
    state_file: str = ""

    def __post_init__(self) -> None:
        within("rows", self.rows, 1, MOST_PLACES)
        within("columns", self.columns, 1, MOST_PLACES)
        if self.rows * self.columns > MOST_PLACES:
            raise OutOfRange(f"rows times columns must be at most {MOST_PLACES}")
        for name, count in (("row_pitch", self.rows), ("column_pitch", self.columns)):
            within(name, getattr(self, name), 0.0 if count == 1 else 0.0005, 2.0)
        for name in ("origin_x", "origin_y", "origin_z"):
            within(name, getattr(self, name), -5.0, 5.0)
        within("turn", self.turn, -360.0, 360.0)
        self.state_file = device_file("state_file", self.state_file)
