"""Data of the world: states of the devices at one instant, labels, events and boards."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from arcor2_fakes.cell.boards import Board
from arcor2_fakes.cell.layout import Matrix, from_rotation_vector

ControllerPose = tuple[float, float, float, float, float, float]
"""Position and rotation vector."""


class Robot(msgspec.Struct, frozen=True):
    """A sample of the robot: TCP in the controller's base, TCP on the flange, outputs (bit mask), joints, rad."""

    tcp_pose: ControllerPose
    tcp_offset: ControllerPose
    digital_outputs: int
    q: tuple[float, ...] = ()

    def base_from_flange(self) -> Matrix:
        """Return the pose of the flange, which does not depend on the TCP that is set."""
        flange: Matrix = from_rotation_vector(self.tcp_pose) @ np.linalg.inv(from_rotation_vector(self.tcp_offset))
        return flange


class Printed(msgspec.Struct, frozen=True):
    """A label from the printer, with its number."""

    number: int
    fields: list[dict[str, Any]]

    @property
    def code(self) -> str:
        """Return the content of its barcode; None if it has none."""
        return next((str(field["text"]) for field in self.fields if field.get("barcode")), "")


class Inputs(msgspec.Struct):
    """The last states of the devices that a cell may have in addition to its robot."""

    belt: float | None = None
    """Position of the conveyor drive, counts."""
    printed: list[Printed] = []
    arm: tuple[float, float] | None = None
    """Angles of the two-axis robot, rad."""
    outputs: list[bool] = []
    """Outputs of the I/O block."""


class Event(msgspec.Struct, frozen=True):
    """An event of a board, `time` s after the start of the world."""

    time: float
    place: str
    why: str


class Label(msgspec.Struct):
    """A label on a board; it is loose until it is pressed on."""

    code: str
    pressed: bool = False


class Thing:
    """A board in the world, its place, and its events."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.place = "feeder"
        self.position: tuple[float, float, float] | None = None
        self.label: Label | None = None
        self.history: list[Event] = []
