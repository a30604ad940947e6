"""Settings of bin and blister."""

import dataclasses
from typing import Annotated

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import Range, device_file, within

MAX_PART = 1.0
"""Largest edge of a part, m."""
MAX_PLACES = 10_000


@dataclasses.dataclass
class BinSettings(Settings):
    """The crate, and the part in it: a box, or a mesh.

    :param length: inside of the crate along x, m
    :param width: inside of the crate along y, m
    :param height: inside of the crate along z, m
    :param part_length: size of a part that is a box along its x, m; 0 for a mesh
    :param part_width: along its y, m
    :param part_height: along its z, m
    :param part_mesh: path of the part's mesh (STL, OBJ, PLY) in metres, instead of the sizes
    :param min_quality: 0 to 1; parts of lower quality are not returned
    :param tolerance: m that a point may be away from the surface of its part: three times the noise of the camera
    :param grip_depth: m below a part's top where it is gripped
    :param max_age: seconds after which an image is too old
    """

    length: Annotated[float, Range(0.02, 3.0, "m")]
    width: Annotated[float, Range(0.02, 3.0, "m")]
    height: Annotated[float, Range(0.02, 3.0, "m")]
    part_length: float = 0.0
    part_width: float = 0.0
    part_height: float = 0.0
    part_mesh: str = ""
    min_quality: Annotated[float, Range(0.3, 1.0)] = 0.9
    tolerance: Annotated[float, Range(0.0005, 0.02, "m")] = 0.004
    grip_depth: Annotated[float, Range(0.0, MAX_PART, "m")] = 0.0
    max_age: Annotated[float, Range(0.1, 3600.0, "s")] = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self.part_mesh = device_file("part_mesh", self.part_mesh)
        sizes = {name: getattr(self, name) for name in ("part_length", "part_width", "part_height")}
        if self.part_mesh:
            if any(sizes.values()):
                raise OutOfRange("part_mesh must be empty for a part that is a box")
        else:
            for name, size in sizes.items():
                within(name, size, 0.003, MAX_PART)


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
    :param turn: rotation of the parts about z relative to the blister, degrees
    :param snake: whether every second row is counted backwards
    :param starts_full: whether all places have a part at the start
    :param state_file: path of a file that stores the state over a restart; empty: the state is not stored
    """

    rows: Annotated[int, Range(1, MAX_PLACES)]
    columns: Annotated[int, Range(1, MAX_PLACES)]
    row_pitch: float
    column_pitch: float
    origin_x: Annotated[float, Range(-5.0, 5.0, "m")] = 0.0
    origin_y: Annotated[float, Range(-5.0, 5.0, "m")] = 0.0
    origin_z: Annotated[float, Range(-5.0, 5.0, "m")] = 0.0
    turn: Annotated[float, Range(-360.0, 360.0, "degrees")] = 0.0
    snake: bool = False
    starts_full: bool = True
    state_file: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rows * self.columns > MAX_PLACES:
            raise OutOfRange("rows times columns must be at most {most_places}", most_places=MAX_PLACES)
        for name, count in (("row_pitch", self.rows), ("column_pitch", self.columns)):
            within(name, getattr(self, name), 0.0 if count == 1 else 0.0005, 2.0)
        self.state_file = device_file("state_file", self.state_file)
