"""The layout of a cell: a JSON file of places in world coordinates, in metres and radians.

    {
      "robot": {"base": POSE},
      "gripper": {"output": 0, "sensor": 0, "tip": POSE, "close_time": 0.1, "open_time": 0.1},
      "feeder": {PLACE, "refill_time": 0.3},
      "reader": {PLACE},
      "tester": {PLACE},
      "good_box": {PLACE},
      "bad_box": {PLACE},
      "table_height": 0.0,
      "belt": {"pose": POSE, "length": 0.6, "pitch": 0.2, "board_length": 0.08, "counts_per_metre": 10000,
               "tolerance": TOLERANCE, "barriers": [{"input": 0, "at": 0.0}]},
      "labelling": {"place": {PLACE}, "arm": {"base": POSE, "links": [0.15, 0.1], "servos": [1, 2]},
                    "press": {"begin": [x, y, z], "end": [x, y, z], "tolerance": 0.008}},
      "tower": {"red": 0, "green": 2}
    }

POSE is ``{"position": [x, y, z], "orientation": [x, y, z, w]}``, the orientation a unit quaternion, by default
[0, 0, 0, 1].
PLACE is ``"pose": POSE, "tolerance": {"position": 0.005, "height": 0.01, "tilt": 0.1, "turn": 0.2}``.

- `robot.base` is the pose of the robot's `base_link` in the world. The base frame of the controller is rotated by 180°
  about z; the world takes that into account.
- `gripper.output` is the number of the digital output of the controller that closes the gripper, `gripper.sensor` that
  of the digital input that is on while a part is gripped (null: no sensor), `gripper.tip` the pose of the grip point on
  the flange, z out. It does not depend on the TCP that is set in the controller.
- The pose of a place is that of a board on it: origin at the grip point, z up. The z axis of the tip points down.
- A released board, or a gripping tip, is at a place when it is at most `position` away horizontally, at most `position`
  below and `height` above it, when the angle between the z axes is at most `tilt` and, if `turn` is given, the rotation
  about z at most `turn`.
- Instead of a `feeder` there may be a `belt`; its pose is that of a board at the stop at its end, x in the direction of
  travel. A light barrier is interrupted (its input of the I/O block is on) while a board is at `at`: position along x
  from the stop, m, 0 or negative.
- `labelling` is the place under the label printer, and the arm whose roller presses labels on from `begin` to `end`.
- `camera` has the pose of a camera's optical frame (x right, y down, z forward), the size of a `board`, and `things`
  that it also sees: boxes with `name`, `pose` of the centre, `size` and `color`; and `markers` (ArUco, 4×4_50) with
  `id`, `pose` of the centre (x right, y up, z out of the marker) and `size`, the side of the black square.
- `robot.model` (ur3e, ur5e, ur10e) is set if the camera sees the arm.
- `tower` maps lamps to outputs of the I/O block. Omit what the cell does not have.
- `reader` is the place where the reader sees a board, gripped or in the feeder; `tester` is the fixture.
"""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
import numpy.typing as npt
from msgspec import Meta
from transforms3d.axangles import axangle2mat
from transforms3d.quaternions import quat2mat

Matrix = npt.NDArray[np.float64]
"""A rigid transform as a homogeneous 4 × 4 matrix."""

Length = Annotated[float, Meta(gt=0.0, le=10.0)]
Angle = Annotated[float, Meta(gt=0.0, le=math.pi)]
Duration = Annotated[float, Meta(ge=0.0, le=60.0)]
Bit = Annotated[int, Meta(ge=0, le=17)]


class LayoutError(ValueError):
    """The layout cannot be read or is invalid; the message names the file and the field."""


class Pose(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A pose in the world or on the flange."""

    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        if abs(math.hypot(*self.orientation) - 1.0) > 1e-3:
            raise ValueError("orientation must be a unit quaternion x, y, z, w")

    def matrix(self) -> Matrix:
        """Return the pose as a transform; do not modify it, because it is cached."""
        return _matrices(self)[0]

    def inverse(self) -> Matrix:
        """Return the inverse transform; do not modify it, because it is cached."""
        return _matrices(self)[1]


@lru_cache(maxsize=64)
def _matrices(pose: Pose) -> tuple[Matrix, Matrix]:
    x, y, z, w = pose.orientation
    matrix = _transform(pose.position, quat2mat((w, x, y, z)))
    inverse = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    return matrix, inverse


class Tolerance(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Largest deviation from a place."""

    position: Length
    height: Length
    tilt: Angle
    turn: Angle | None = None

    def allows(self, place_from_board: Matrix, along: float = 0.0) -> bool:
        """Return whether a board at a pose is close enough to the point `along` m along the x axis of the place."""
        x, y, z = place_from_board[:3, 3]
        if math.hypot(x - along, y) > self.position or not -self.position <= z <= self.height:
            return False
        if math.acos(max(-1.0, min(1.0, place_from_board[2, 2]))) > self.tilt:
            return False
        return self.turn is None or abs(math.atan2(place_from_board[1, 0], place_from_board[0, 0])) <= self.turn


class Place(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A place for a board."""

    pose: Pose
    tolerance: Tolerance

    def holds(self, world_from_board: Matrix) -> bool:
        """Return whether a board at a pose is at this place."""
        return self.tolerance.allows(self.pose.inverse() @ world_from_board)


class Feeder(Place, frozen=True, forbid_unknown_fields=True):
    """A magazine that moves the next board to the pick place."""

    refill_time: Duration = 0.3


class Barrier(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A light barrier across the belt, wired to an input of the I/O block."""

    input: Annotated[int, Meta(ge=0, le=15)]
    at: Annotated[float, Meta(ge=-10.0, le=0.0)]


class Belt(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A belt with a loader at its start and a stop at its end."""

    pose: Pose
    tolerance: Tolerance
    length: Length
    pitch: Length
    board_length: Length
    counts_per_metre: Annotated[float, Meta(ge=1.0, le=1e8)]
    barriers: list[Barrier] = []

    def __post_init__(self) -> None:
        if not self.board_length <= self.pitch <= self.length:
            raise ValueError("pitch must be at least board_length and at most length")


class Arm(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A planar two-axis robot: lengths of its links, m, and ids of its servos on the bus."""

    base: Pose
    links: tuple[Length, Length]
    servos: tuple[int, int] = (1, 2)


class Press(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The path of the roller over a label, in the world."""

    begin: tuple[float, float, float]
    end: tuple[float, float, float]
    tolerance: Length

    def __post_init__(self) -> None:
        if math.dist(self.begin, self.end) <= 2.0 * self.tolerance:
            raise ValueError("the distance from begin to end must be more than twice the tolerance")


class Labelling(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The place under the label printer, and the arm that presses labels on."""

    place: Place
    arm: Arm
    press: Press


class Fixture(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A fixed box that the camera sees; `pose` is that of its centre, `color` is R, G, B."""

    name: str
    pose: Pose
    size: tuple[Length, Length, Length]
    color: tuple[int, int, int] = (150, 150, 150)


class Marker(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An ArUco marker (4×4_50); `pose` is that of its centre, z out of the marker."""

    id: Annotated[int, Meta(ge=0, le=49)]
    pose: Pose
    size: Length


class Camera(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A camera: the pose of its optical frame, the fixed objects that it sees, and the size of a board."""

    pose: Pose
    board: tuple[Length, Length, Length]
    things: list[Fixture] = []
    markers: list[Marker] = []


class Robot(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Pose of the robot, and its model for the camera."""

    base: Pose
    model: Literal["ur3e", "ur5e", "ur10e"] | None = None


class Gripper(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A gripper on the flange, switched by one output."""

    output: Bit
    sensor: Bit | None = None
    tip: Pose = Pose((0.0, 0.0, 0.0))
    close_time: Duration = 0.1
    open_time: Duration = 0.1


class Layout(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A cell."""

    robot: Robot
    gripper: Gripper
    reader: Place
    tester: Place
    good_box: Place
    bad_box: Place
    feeder: Feeder | None = None
    belt: Belt | None = None
    labelling: Labelling | None = None
    camera: Camera | None = None
    tower: dict[str, Annotated[int, Meta(ge=0, le=15)]] = {}
    table_height: float = 0.0

    def __post_init__(self) -> None:
        if (self.feeder is None) == (self.belt is None):
            raise ValueError("the layout must have either a feeder or a belt")

    def needs(self) -> list[str]:
        """Return the required devices in addition to robot, tester and reader."""
        needed = {
            "conveyor": self.belt is not None,
            "io": bool(self.tower) or (self.belt is not None and bool(self.belt.barriers)),
            "printer": self.labelling is not None,
            "arm": self.labelling is not None,
            "camera": self.camera is not None,
        }
        return [name for name, so in needed.items() if so]


def read_layout(path: Path) -> Layout:
    """Read a layout from a JSON file.

    Raises:
        LayoutError: The file is missing or invalid.
    """
    try:
        return msgspec.json.decode(path.read_bytes(), type=Layout)
    except OSError as e:
        raise LayoutError(f"layout {path}: {e.strerror}") from e
    except msgspec.DecodeError as e:
        raise LayoutError(f"layout {path}: {e}") from e


def from_rotation_vector(pose: tuple[float, float, float, float, float, float]) -> Matrix:
    """Return the transform of a position and rotation vector."""
    angle = math.hypot(*pose[3:])
    rotation = np.eye(3) if angle < 1e-12 else axangle2mat(pose[3:], angle)
    return _transform(pose[:3], rotation)


def _transform(position: tuple[float, float, float], rotation: Matrix) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = position
    return matrix
