"""Base class of all tasks of the compute workers, and their errors."""

import enum
from typing import Any, ClassVar, Final, Generic, TypeVar

from msgspec import Struct

from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message

R = TypeVar("R")

MAX_PICTURE: Final = 64 * 1024 * 1024
"""Maximum size of one image file, bytes."""


class WorkerKind(enum.StrEnum):
    """Kinds of compute worker. Each kind has its own process, so that slow calibrations do not delay kinematics."""

    KINEMATICS = "kinematics"
    CALIBRATION = "calibration"
    MESHES = "meshes"
    DRY_RUN = "dry_run"
    HISTORY = "history"


class Task(Struct, Generic[R], frozen=True, tag=True):
    """A task for a compute worker. Its result has the type R.

    Class Attributes:
        result_type: R, for decoding.
        function: "module:function". The function takes the task and a WorkerState, and returns an R.
        worker: The kind of worker that runs it.
        timeout: Maximum time, s.
        label: The task in messages, such as "forward kinematics".
        cancellable: Whether the worker ends when the caller is cancelled; otherwise the computation runs to its end.
    """

    result_type: ClassVar[Any]
    function: ClassVar[str]
    worker: ClassVar[WorkerKind]
    timeout: ClassVar[float] = 10.0
    label: ClassVar[Message]
    cancellable: ClassVar[bool] = False


class ComputeStopped(Arcor2Error):
    """The compute worker ended during a computation. A new one is started for the next task."""

    code = "compute_stopped"


class ComputeTimeout(Arcor2Error):
    """A computation exceeded its time limit."""

    code = "compute_timeout"


class ComputeBusy(Arcor2Error):
    """Too many computations are waiting."""

    code = "compute_busy"


class NotInstalled(Arcor2Error):
    """A library that the computation needs is not installed."""

    code = "not_installed"
