"""Calibration targets: markers and boards, and their poses. Imports no numerics.

Frames. Camera: optical frame (x right, y down, z forward). Marker: origin in its middle, x right, y up, z out of it
towards the viewer. Board: the same, as if it was one large marker. Lengths in m.
"""

from typing import Literal

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.messages import Message

MarkerDictionary = Literal[
    "4x4_50", "4x4_100", "4x4_250", "4x4_1000",
    "5x5_50", "5x5_100", "5x5_250", "5x5_1000",
    "6x6_50", "6x6_100", "6x6_250", "6x6_1000",
    "7x7_50", "7x7_100", "7x7_250", "7x7_1000",
    "original", "apriltag_16h5", "apriltag_25h9", "apriltag_36h10", "apriltag_36h11", "mip_36h12",
]  # fmt: skip
"""ArUco's predefined dictionaries. The protocol uses 4x4_50."""


class Marker(Data, frozen=True):
    """One ArUco marker.

    Attributes:
        pose: Pose in the frame of the origin.
        size: Side of its black square, m; unset: the size of the layout.
    """

    marker_id: int
    pose: Pose
    size: float | Unset = UNSET


class CharucoBoard(Data, frozen=True):
    """One ChArUco board of columns × rows squares with markers numbered from `first_id`.

    Attributes:
        square: Side of a square, m.
        marker: Side of a marker, m.
        pose: Pose of the board's middle in the frame of the origin.
        legacy_pattern: Whether it was printed by OpenCV before 4.6 with an even number of rows, which has a white
            square in the upper left corner.
    """

    columns: int
    rows: int
    square: float
    marker: float
    dictionary: MarkerDictionary = "4x4_50"
    first_id: int = 0
    legacy_pattern: bool = False
    pose: Pose = field(default_factory=Pose)


class Layout(Data, frozen=True):
    """Markers and boards with their poses.

    Attributes:
        size: Side of markers that state none, m.
        dictionary: Dictionary of the markers.
    """

    markers: list[Marker] = field(default_factory=list)
    boards: list[CharucoBoard] = field(default_factory=list)
    size: float = 0.1
    dictionary: MarkerDictionary = "4x4_50"


def item_name(name: str) -> Message:
    """Return the name of a marker or board as a value of messages."""
    kind, _, number = name.partition(" ")
    if kind == "marker":
        return Message.of("marker {number}", number=number)
    return Message.of("board {number}", number=number)
