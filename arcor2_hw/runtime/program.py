"""A program while it runs: what is told of its actions, how it is paced, how it is stopped."""

import threading
import traceback
from collections.abc import Sequence, Set
from typing import Any, Final, Protocol

import msgspec

from arcor2_hw.data.cell import Cell as CellFile
from arcor2_hw.data.events import (
    ActionStateAfterData,
    ActionStateBeforeData,
    Event,
    PackageInfoData,
    ProjectExceptionData,
)
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.project import Project, ProjectRobotJoints
from arcor2_hw.exceptions import Arcor2Error, ConnectionLost, InvalidData, NotFound, ProgramStopped
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.device import STOP_DEADLINE, Device, describe
from arcor2_hw.runtime.lane import Job
from arcor2_hw.runtime.pacing import Gate
from arcor2_hw.runtime.values import encode_shown, results

POINT: Final = "action_point_id"
"""The attribute by which a pose knows its action point."""
STILL_WITHIN: Final = 2.0
"""Seconds that a device gets to stand still after the action before a pause."""

_encode = msgspec.json.Encoder().encode


class Channel(Protocol):
    """Where a program tells of itself."""

    def event(self, name: str, encoded: bytes) -> None:
        """Pass on an encoded event."""

    def changed(self, state: str) -> None:
        """Tell that the program is running or paused now."""


class Program:
    """One run. `stop` comes from another thread, all else from the script's threads."""

    def __init__(
        self,
        channel: Channel,
        package_id: str,
        *,
        start_paused: bool = False,
        breakpoints: Set[str] = frozenset(),
        here: CellFile | None = None,
    ) -> None:
        self.channel = channel
        self.here = here
        """The settings of devices at this place, which win over those of the package."""
        self.package_id = package_id
        self.cell = Cell()
        self.breakpoints = frozenset(breakpoints)
        self.gate = Gate(
            channel.changed,
            lambda: self.cell.wait_still(STILL_WITHIN),
            start_paused=start_paused,
            breakpoints=self.breakpoints,
        )
        self.stop_requested = False
        self.ended = False
        """The script is over; what follows is closing, which no stop may interrupt."""
        self.inside = False
        """The script's main thread is in our code, where an exception out of nowhere would do harm."""
        self.error: BaseException | None = None
        self._blamed: tuple[BaseException, Device] | None = None
        self._main = threading.main_thread()
        self._telling = threading.Lock()
        self._device_lost = False
        self._stops: list[tuple[Device, Job]] = []
        self._stop_sent = threading.Event()
        self._action_ids: dict[str, str] = {}
        self._joints_points: dict[str, str] = {}

    # -------------------------------------------------------------------------------- the project
    def load(self, project: Project) -> None:
        """Take the names of actions and points from the project; NotFound for a breakpoint that is no action point."""
        self._action_ids = {a.name: a.id for point in project.action_points for a in point.actions}
        self._joints_points = {j.id: point.id for point in project.action_points for j in point.robot_joints}
        if unknown := self.breakpoints - {point.id for point in project.action_points}:
            raise NotFound(f"a breakpoint is set on {', '.join(sorted(unknown))}, which is no action point")

    def started(self, info: PackageInfoData) -> None:
        """Tell that everything is up and the first action follows."""
        self.channel.changed("running")
        self.channel.event("PackageInfo", _encode(Event("PackageInfo", data=info)))

    # -------------------------------------------------------------------------------- actions
    @property
    def in_main_thread(self) -> bool:
        """Tell whether the present thread is the script's first."""
        return threading.current_thread() is self._main

    def check(self) -> None:
        """Raise ProgramStopped once somebody has stopped the program."""
        if self.stop_requested:
            raise ProgramStopped

    def points_of(self, arguments: Sequence[Any]) -> set[str]:
        """Give the action points whose poses and joints are among the arguments."""
        points: set[str] = set()
        for argument in arguments:
            if isinstance(argument, Pose):
                if (point := argument.__dict__.get(POINT)) is not None:
                    points.add(point)
            elif isinstance(argument, ProjectRobotJoints) and (known := self._joints_points.get(argument.id)):
                points.add(known)
        return points

    def action_begins(self, what: str, name: str | None, arguments: Sequence[Any]) -> str | None:
        """Tell that action `name` begins, and wait for leave; gives its id, None in a project without actions.

        Raises InvalidData when the project knows no such action, ProgramStopped.
        """
        self.check()
        action_id: str | None = None
        if self._action_ids:
            if name is None:
                raise InvalidData(f"{what} is called without the name of its action (an=...)")
            action_id = self._action_ids.get(name)
            if action_id is None:
                raise InvalidData(f"{what}: the project has no action named {name!r}")
        points = self.points_of(arguments)
        data = ActionStateBeforeData(
            msgspec.UNSET if action_id is None else action_id,
            [encode_shown(argument) for argument in arguments] if arguments else msgspec.UNSET,
            points or msgspec.UNSET,
            msgspec.UNSET if self.in_main_thread else threading.get_ident(),
        )
        self.channel.event("ActionStateBefore", _encode(Event("ActionStateBefore", data=data)))
        self.gate.before(points)
        return action_id

    def action_ended(self, action_id: str | None, value: Any) -> None:
        """Tell that an action has ended with a result, and wait for leave to go on. Raises ProgramStopped."""
        if action_id is not None:
            data = ActionStateAfterData(action_id, results(value) or msgspec.UNSET)
            self.channel.event("ActionStateAfter", _encode(Event("ActionStateAfter", data=data)))
        self.gate.after()

    def action_failed(self) -> None:
        """Say that an action is over without a result. Raises ProgramStopped."""
        self.gate.after()

    def blame(self, device: Device, error: BaseException) -> None:
        """Note from which device an error came, so that whoever reads it learns which one."""
        self._blamed = error, device

    # -------------------------------------------------------------------------------- ends
    def stop(self) -> None:
        """Stop all devices past whatever they do, then let nothing of the script go on."""
        self.stop_requested = True
        self._stops = self.cell.stop_all(ProgramStopped("the program was stopped"))
        self._stop_sent.set()
        self.cell.abandon()
        self.gate.stop()

    def device_lost(self, device: Device, reason: str) -> bool:
        """Stop because a device is lost; tells whether that was necessary."""
        error = ConnectionLost(f"{device.name}: the connection is lost, so the program was stopped", reason)
        with self._telling:
            if self.ended or self.stop_requested or self.error is not None:
                return False
            self._device_lost = True
            self._tell_exception(describe(device, error))
        self.stop()
        return True

    def settle(self, failed: bool) -> Arcor2Error | None:
        """Wait for the stop that was sent; after a failure send it, so that nothing goes on moving.

        Gives the first device that did not obey.
        """
        if self.stop_requested:
            self._stop_sent.wait(STOP_DEADLINE)  # the script may be out before the last device was told
        elif failed:
            self._stops = self.cell.stop_all()
        return self.cell.wait_stopped(self._stops)

    def exception(self, error: BaseException) -> None:
        """Tell of an exception that ended the script; one that was told already is not told again."""
        with self._telling:
            if self.error is not error and not self._device_lost:
                self._tell_exception(error)

    def _tell_exception(self, error: BaseException) -> None:
        self.error = error
        text = str(error) or type(error).__name__
        if self._blamed is not None and self._blamed[0] is error:
            text = str(describe(self._blamed[1], error))
        data = ProjectExceptionData(text, type(error).__name__, isinstance(error, Arcor2Error))
        self.channel.event("ProjectException", _encode(Event("ProjectException", data=data)))


def traceback_text(error: BaseException) -> str:
    """Give the traceback of an exception as text."""
    return "".join(traceback.format_exception(error))


_current: Program | None = None


def current() -> Program | None:
    """Give the program that this process runs for the server, None in a script started by hand."""
    return _current


def set_current(program: Program | None) -> None:
    """Say which program `Resources` belongs to."""
    global _current
    _current = program
