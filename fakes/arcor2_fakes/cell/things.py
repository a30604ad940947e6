"""Things in the world and what is sensed of the fakes at one instant."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from arcor2_fakes.cell.boards import Board
from arcor2_fakes.cell.layout import Matrix, from_rotation_vector

ControllerPose = tuple[float, float, float, float, float, float]
"""Position and rotation vector."""


class Robot(msgspec.Struct, frozen=True):
    """One sample of the robot: the TCP in the controller's base, on the flange, the digital outputs as bits, joints."""

    tcp_pose: ControllerPose
    tcp_offset: ControllerPose
    digital_outputs: int
    q: tuple[float, ...] = ()

    def base_from_flange(self) -> Matrix:
        """Return the flange, which stands where it stands whatever TCP somebody has set."""
        flange: Matrix = from_rotation_vector(self.tcp_pose) @ np.linalg.inv(from_rotation_vector(self.tcp_offset))
        return flange


class Printed(msgspec.Struct, frozen=True):
    """A label that has come out of the printer; printers number theirs."""

    number: int
    fields: list[dict[str, Any]]

    @property
    def code(self) -> str:
        """Return what its bar code says, or nothing."""
        return next((str(field["text"]) for field in self.fields if field.get("barcode")), "")


class Inputs(msgspec.Struct):
    """What the world has last heard of the devices that a cell may have beside its robot."""

    belt: float | None = None
    """Counts of the conveyor's drive."""
    printed: list[Printed] = []
    arm: tuple[float, float] | None = None
    """Angles of the two-axis robot, rad."""
    outputs: list[bool] = []
    """Outputs of the I/O block."""


class Event(msgspec.Struct, frozen=True):
    """Something that happened to a board, seconds after the world began."""

    time: float
    place: str
    why: str


class Label(msgspec.Struct):
    """A label on a board; until it is pressed on, it only lies there."""

    code: str
    pressed: bool = False


class Thing:
    """A board in the world, where it is, and what happened to it."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.place = "feeder"
        self.position: tuple[float, float, float] | None = None
        self.label: Label | None = None
        self.history: list[Event] = []
