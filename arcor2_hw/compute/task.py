"""What every question to the compute worker declares."""

import enum
from typing import Any, ClassVar, Final, Generic, TypeVar

from msgspec import Struct

from arcor2_hw.exceptions import Arcor2Error

R = TypeVar("R")

MAX_PICTURE: Final = 64 * 1024 * 1024
"""Bytes of one picture's file."""


class Room(enum.StrEnum):
    """Which worker does it. One process each: a calibration of seconds delays no kinematics of a millisecond."""

    KINEMATICS = "kinematics"
    CALIBRATION = "calibration"
    MESHES = "meshes"


class Task(Struct, Generic[R], frozen=True, tag=True):
    """A question; its answer is of the type R.

    Class data: gives: R for msgspec. runs: "module:function" that takes the task and a Desk, and gives an R. room:
    where. within: seconds that it may take. what: what it is, as it stands in a sentence.
    """

    gives: ClassVar[Any]
    runs: ClassVar[str]
    room: ClassVar[Room]
    within: ClassVar[float] = 10.0
    what: ClassVar[str]


class ComputeStopped(Arcor2Error):
    """The compute worker ended in the middle of a computation; a new one is started for the next."""

    code = "compute_stopped"


class ComputeTimeout(Arcor2Error):
    """A computation took longer than it may."""

    code = "compute_timeout"


class ComputeBusy(Arcor2Error):
    """Too many computations wait already."""

    code = "compute_busy"


class NotInstalled(Arcor2Error):
    """What computes this is not installed here."""

    code = "not_installed"
