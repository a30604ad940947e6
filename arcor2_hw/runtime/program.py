"""A running program: how its actions are reported, how it is paused, how it is stopped."""

import itertools
import threading
import time
import traceback
from collections.abc import Mapping, Sequence, Set
from types import MappingProxyType
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
from arcor2_hw.data.secret import ObjectSecrets
from arcor2_hw.exceptions import Arcor2Error, ConnectionLost, InvalidData, NotFound, ProgramStopped
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.device import STOP_DEADLINE, Device, describe
from arcor2_hw.runtime.pacing import Gate
from arcor2_hw.runtime.stopping import SentStop, wait_stopped
from arcor2_hw.runtime.values import encode_shown, results

POINT: Final = "action_point_id"
"""The attribute by which a pose knows its action point."""
STILL_WITHIN: Final = 2.0
"""Seconds that a device has to come to standstill after the action before a pause."""

_encode = msgspec.json.Encoder().encode


class Channel(Protocol):
    """Destination of the events of a program."""

    def event(self, name: str, encoded: bytes, number: int = 0, action: str = "", time: float = 0.0) -> None:
        """Pass on an encoded event; of an action with the number of its call, its name, and a time (ProgramEvent)."""

    def changed(self, state: str) -> None:
        """Report that the program is running or paused."""

    def action_over(self, number: int, duration: float, error: str) -> None:
        """Report the end of an action that has no event: by an error, or in a project without actions."""


class Action:
    """One call of an action. `id` is None in a project that knows no actions."""

    __slots__ = ("began", "id", "number")

    def __init__(self, number: int, action_id: str | None) -> None:
        self.number = number
        self.id = action_id
        self.began = 0.0


class Program:
    """One run. `stop` comes from another thread, all else from the script's threads."""

    def __init__(
        self,
        channel: Channel,
        package_id: str,
        *,
        start_paused: bool = False,
        breakpoints: Set[str] = frozenset(),
        shared_breakpoints: Set[str] = frozenset(),
        here: CellFile | None = None,
        secrets: Mapping[str, ObjectSecrets] = MappingProxyType({}),
    ) -> None:
        self.channel = channel
        self.here = here
        """The settings of devices at this place, which win over those of the package."""
        self.secrets = secrets
        """Values of secret settings by the id of the object."""
        self.package_id = package_id
        self.cell = Cell()
        self.breakpoints = frozenset(breakpoints)
        self.gate = Gate(
            channel.changed,
            lambda: self.cell.wait_still(STILL_WITHIN),
            start_paused=start_paused,
            breakpoints=self.breakpoints | shared_breakpoints,
        )
        self.stop_requested = False
        self.ended = False
        """The script has ended; the devices are being closed, which no stop may interrupt."""
        self.inside = False
        """The main thread of the script is in our code, where an asynchronous exception would do harm."""
        self.error: BaseException | None = None
        self._blamed: tuple[BaseException, Device] | None = None
        self._failed: tuple[BaseException, Action] | None = None
        self._main = threading.main_thread()
        self._telling = threading.Lock()
        self._device_lost = False
        self._stops: list[SentStop] = []
        self._stop_sent = threading.Event()
        self._action_ids: dict[str, str] = {}
        self._joints_points: dict[str, str] = {}
        self._numbers = itertools.count(1)

    # -------------------------------------------------------------------------------- the project
    def load(self, project: Project) -> None:
        """Read the names of actions and points from the project; NotFound for an unknown breakpoint."""
        self._action_ids = {a.name: a.id for point in project.action_points for a in point.actions}
        self._joints_points = {j.id: point.id for point in project.action_points for j in point.robot_joints}
        if unknown := self.breakpoints.difference((p.id for p in project.action_points), self._action_ids.values()):
            raise NotFound(
                "a breakpoint is set on {unknown}, which is no action point or action",
                unknown=", ".join(sorted(unknown)),
            )

    def started(self, info: PackageInfoData) -> None:
        """Report that all devices are connected and the first action follows."""
        self.channel.changed("running")
        self.channel.event("PackageInfo", _encode(Event("PackageInfo", data=info)))

    # -------------------------------------------------------------------------------- actions
    @property
    def in_main_thread(self) -> bool:
        """Return whether the current thread is the main thread of the script."""
        return threading.current_thread() is self._main

    def check(self) -> None:
        """Raise ProgramStopped if the program was stopped."""
        if self.stop_requested:
            raise ProgramStopped

    def points_of(self, arguments: Sequence[Any]) -> set[str]:
        """Return the action points whose poses and joints are among the arguments."""
        points: set[str] = set()
        for argument in arguments:
            if isinstance(argument, Pose):
                if (point := argument.__dict__.get(POINT)) is not None:
                    points.add(point)
            elif isinstance(argument, ProjectRobotJoints) and (known := self._joints_points.get(argument.id)):
                points.add(known)
        return points

    def set_shared_breakpoints(self, ids: Set[str]) -> None:
        """Set breakpoints in addition to those that were given at the start."""
        self.gate.set_breakpoints(self.breakpoints | ids)

    def action_begins(self, what: str, name: str | None, arguments: Sequence[Any]) -> Action:
        """Report that action `name` starts, and wait while the program is paused.

        Raises InvalidData when the project knows no such action, ProgramStopped.
        """
        self.check()
        action_id: str | None = None
        if self._action_ids:
            if name is None:
                raise InvalidData("{what} is called without the name of its action (an=...)", what=what)
            action_id = self._action_ids.get(name)
            if action_id is None:
                raise InvalidData("{what}: the project has no action named {name!r}", what=what, name=name)
        points = self.points_of(arguments)
        thread = None if self.in_main_thread else threading.get_ident()
        data = ActionStateBeforeData(
            msgspec.UNSET if action_id is None else action_id,
            [encode_shown(argument) for argument in arguments] if arguments else msgspec.UNSET,
            points or msgspec.UNSET,
            msgspec.UNSET if thread is None else thread,
        )
        action = Action(next(self._numbers), action_id)
        encoded = _encode(Event("ActionStateBefore", data=data))
        self.channel.event("ActionStateBefore", encoded, action.number, name or what, time.time())
        self.gate.before(points if action_id is None else points | {action_id})
        action.began = time.monotonic()
        return action

    def action_ended(self, action: Action, value: Any) -> None:
        """Report the result of an action that has ended; wait while the program is paused. Raises ProgramStopped."""
        duration = time.monotonic() - action.began
        if action.id is None:
            self.channel.action_over(action.number, duration, "")
        else:
            data = ActionStateAfterData(action.id, results(value) or msgspec.UNSET)
            encoded = _encode(Event("ActionStateAfter", data=data))
            self.channel.event("ActionStateAfter", encoded, action.number, time=duration)
        self.gate.after()

    def action_failed(self, action: Action, error: BaseException) -> None:
        """Report that an action has ended without a result. Raises ProgramStopped."""
        self._failed = error, action
        duration = time.monotonic() - action.began
        self.channel.action_over(action.number, duration, str(error) or type(error).__name__)
        self.gate.after()

    def blame(self, device: Device, error: BaseException) -> None:
        """Record which device an error came from, so that its report names the device."""
        self._blamed = error, device

    # -------------------------------------------------------------------------------- ends
    def stop(self) -> None:
        """Stop all devices next to any running call, then end the script."""
        self.stop_requested = True
        self._stops = self.cell.stop_all(ProgramStopped("the program was stopped"))
        self._stop_sent.set()
        self.cell.abandon()
        self.gate.stop()

    def device_lost(self, device: Device, reason: str) -> bool:
        """Stop because a device is lost; return whether that was necessary."""
        error = ConnectionLost("{name}: the connection is lost, so the program was stopped", reason, name=device.name)
        with self._telling:
            if self.ended or self.stop_requested or self.error is not None:
                return False
            self._device_lost = True
            self._tell_exception(describe(device, error))
        self.stop()
        return True

    def settle(self, failed: bool) -> Arcor2Error | None:
        """Wait for the stop that was sent; after a failure send it first, so that no device keeps moving.

        Return the error of the first device that did not stop.
        """
        if self.stop_requested:
            self._stop_sent.wait(STOP_DEADLINE)  # the script may end before the stop is sent to the last device
        elif failed:
            self._stops = self.cell.stop_all()
        return wait_stopped(self._stops)

    def sent_stops(self) -> list[SentStop]:
        """Return the stops of a program that is being stopped, once they are sent to all devices."""
        self._stop_sent.wait(STOP_DEADLINE)
        return self._stops

    def exception(self, error: BaseException) -> None:
        """Report an exception that ended the script, once."""
        with self._telling:
            if self.error is not error and not self._device_lost:
                self._tell_exception(error)

    def _tell_exception(self, error: BaseException) -> None:
        self.error = error
        text = str(error) or type(error).__name__
        if self._blamed is not None and self._blamed[0] is error:
            text = str(describe(self._blamed[1], error))
        action_id: str | msgspec.UnsetType = msgspec.UNSET
        if self._failed is not None and self._failed[0] is error and self._failed[1].id is not None:
            action_id = self._failed[1].id
        data = ProjectExceptionData(text, type(error).__name__, isinstance(error, Arcor2Error), action_id)
        self.channel.event("ProjectException", _encode(Event("ProjectException", data=data)))


def traceback_text(error: BaseException) -> str:
    """Return the traceback of an exception as text."""
    return "".join(traceback.format_exception(error))


_current: Program | None = None


def current() -> Program | None:
    """Return the program that this process runs for the server; None in a script started by hand."""
    return _current


def set_current(program: Program | None) -> None:
    """Say which program `Resources` belongs to."""
    global _current
    _current = program
