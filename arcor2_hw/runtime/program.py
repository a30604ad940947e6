"""A running program: reporting of its actions, pause and stop."""

import contextvars
import itertools
import threading
import time
from collections.abc import Callable, Mapping, Sequence, Set
from types import MappingProxyType
from typing import Any, Final, NamedTuple

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
from arcor2_hw.data.interlocks import InterlockState
from arcor2_hw.data.parts import DoneAction
from arcor2_hw.data.position import Frame
from arcor2_hw.data.project import CALL, Project, ProjectRobotJoints
from arcor2_hw.data.secret import ObjectSecrets
from arcor2_hw.exceptions import (
    ENDS_PROGRAM,
    Arcor2Error,
    ConnectionLost,
    InvalidData,
    NotFound,
    ProgramStopped,
    message_of,
)
from arcor2_hw.messages import Message
from arcor2_hw.runtime.branches import Action, Branches
from arcor2_hw.runtime.cell import Cell, SceneFault
from arcor2_hw.runtime.channel import Channel
from arcor2_hw.runtime.continuing import value_of
from arcor2_hw.runtime.device import STOP_DEADLINE, Device, describe
from arcor2_hw.runtime.interlocks import Interlocks
from arcor2_hw.runtime.pacing import Gate
from arcor2_hw.runtime.record import RunRecord
from arcor2_hw.runtime.recovery import ActionCall, Decision, Post, Recovery, mark_decided
from arcor2_hw.runtime.remote_objects import RemoteObjects
from arcor2_hw.runtime.stopping import SentStop, wait_stopped
from arcor2_hw.runtime.values import encode_shown, results

ACTION_POINT_ATTRIBUTE: Final = "action_point_id"
"""Attribute of a pose with the id of its action point."""
STANDSTILL_TIMEOUT: Final = 2.0
"""Time that a device has to come to standstill after the action before a pause, s."""

ATTEMPT: Final = contextvars.ContextVar("attempt", default=1)
"""Number of the attempt of an action that is retried, from 1."""
RETRIES: Final = contextvars.ContextVar("retries", default=0)
"""Maximum number of automatic repetitions of a failed action."""

_encode = msgspec.json.Encoder().encode


class ActionError(NamedTuple):
    """The error of an action that the program handles."""

    device: str
    """Name of the device; empty if no device raised the error."""
    kind: str
    """Code of the error, such as `device_timeout`."""
    text: str
    """Message for the operator."""


class Program:
    """One run of a program. Another thread calls `stop`; the threads of the script call everything else."""

    def __init__(
        self,
        channel: Channel,
        package_id: str,
        *,
        start_paused: bool = False,
        breakpoints: Set[str] = frozenset(),
        shared_breakpoints: Set[str] = frozenset(),
        cell_file: CellFile | None = None,
        secrets: Mapping[str, ObjectSecrets] = MappingProxyType({}),
        held: Post | None = None,
        record: RunRecord | None = None,
        interlock_states: Callable[[list[InterlockState]], None] = lambda _: None,
        values: Mapping[str, str] = MappingProxyType({}),
        remotes: RemoteObjects | None = None,
    ) -> None:
        self.channel = channel
        self.record = record
        """Manages the part inventory and stores checkpoints; None if nothing is stored."""
        self.cell_file = cell_file
        """Settings of devices in this cell, which override those of the package."""
        self.secrets = secrets
        """Values of the secret settings by object id."""
        self.values = values
        """Values of constants and variables by id, JSON in a string, which replace those of the package."""
        self.remotes = remotes
        self.package_id = package_id
        self.cell = Cell()
        self.interlocks = Interlocks(lambda: self.cell, interlock_states)
        self.breakpoints = frozenset(breakpoints)
        self.gate = Gate(
            channel.changed,
            lambda: self.cell.wait_standstill(STANDSTILL_TIMEOUT),
            start_paused=start_paused,
            breakpoints=self.breakpoints | shared_breakpoints,
        )
        self.recovery: Recovery | None = None
        """Holds the program after a failure; None if it ends."""
        if held is not None:
            self.recovery = Recovery(self.gate, self.cell, lambda: self.cell.wait_standstill(STANDSTILL_TIMEOUT), held)
        self.stop_requested = False
        self.ended = False
        """Whether the script has ended. The devices are being closed then, which a stop must not interrupt."""
        self.inside = False
        """Whether the main thread runs code of this library, in which an asynchronous exception must not be raised."""
        self.error: BaseException | None = None
        self.branches = Branches()
        self._reporting = threading.Lock()
        self._device_lost = False
        self._stops: list[SentStop] = []
        self._stop_sent = threading.Event()
        self._action_ids: dict[str, str] = {}
        self._functions: dict[str, str] = {}
        """The called functions by the ids of the actions that call them."""
        self._joints_points: dict[str, str] = {}
        self._numbers = itertools.count(1)

    # -------------------------------------------------------------------------------- the project
    def load(self, project: Project) -> None:
        """Read the names of actions and points from the project.

        Raises:
            NotFound: A breakpoint is not at an action or action point of the project.
        """
        self._action_ids = {action.name: action.id for action in project.all_actions()}
        types = {action.id: action.type.partition("/") for action in project.all_actions()}
        self._functions = {key: called for key, (called, _, method) in types.items() if method == CALL}
        self._joints_points = {j.id: point.id for point in project.action_points for j in point.robot_joints}
        if self.recovery is not None:
            self.recovery.load(project)
        if unknown := self.breakpoints.difference((p.id for p in project.action_points), self._action_ids.values()):
            raise NotFound(
                "a breakpoint is at {unknown}, which is not an action point or action",
                unknown=", ".join(sorted(unknown)),
            )

    def take_control(self) -> None:
        """Take control of all devices. If a device refuses, the program is held before its first action.

        Raises:
            SceneFault: a device refuses, and the program is not held after failures.
        """
        for device, error in self.cell.take_control():
            if self.recovery is None or not self.recovery.active:
                raise SceneFault(device.id, describe(device, error)) from error
            self.recovery.hold_before_next(device, error)

    def started(self, info: PackageInfoData) -> None:
        """Report that all devices are connected and the program starts."""
        self.channel.changed("running")
        self.channel.event("PackageInfo", _encode(Event("PackageInfo", data=info)))

    # -------------------------------------------------------------------------------- actions
    @property
    def in_main_thread(self) -> bool:
        """Return whether the current thread is the main thread of the script."""
        return self.branches.in_main_thread

    def check(self) -> None:
        """Raise ProgramStopped if the program was stopped."""
        if self.stop_requested:
            raise ProgramStopped

    def points_of(self, arguments: Sequence[Any]) -> set[str]:
        """Return the action points whose poses and joints are among the arguments."""
        points: set[str] = set()
        for argument in arguments:
            if isinstance(argument, Pose):
                if (point := argument.__dict__.get(ACTION_POINT_ATTRIBUTE)) is not None:
                    points.add(point)
            elif isinstance(argument, ProjectRobotJoints) and (known := self._joints_points.get(argument.id)):
                points.add(known)
        return points

    def set_shared_breakpoints(self, ids: Set[str]) -> None:
        """Replace the breakpoints that users share. The breakpoints given at the start remain."""
        self.gate.set_breakpoints(self.breakpoints | ids)

    def action_begins(self, device: str, action: str, name: str | None, arguments: Sequence[Any]) -> Action:
        """Report that an action starts, and wait while the program is paused.

        Args:
            device: Id of the object.
            action: Device and method, for messages.
            name: Name of the action in the project.
            arguments: Values of the parameters.

        Raises:
            InvalidData: The project has no such action.
            ProgramStopped: The program was stopped.
        """
        return self._begin(device, action, name, arguments, is_call=False)

    def function_begins(self, action: str, name: str | None, arguments: Sequence[Any]) -> Action:
        """Report that a function is called, as an action without a device. `action_begins` states the arguments."""
        return self._begin("", action, name, arguments, is_call=True)

    def action_repeats(
        self, former: Action, device: str, action: str, name: str | None, arguments: Sequence[Any]
    ) -> Action:
        """Report that an action starts again because a person has decided so. `action_begins` states the arguments."""
        return self._begin(device, action, name, arguments, is_call=False, attempt=former.attempt + 1)

    def _begin(
        self, device: str, what: str, name: str | None, arguments: Sequence[Any], *, is_call: bool, attempt: int = 0
    ) -> Action:
        """Report an action or call. attempt: of an action that a person has decided to repeat, which does not pause."""
        self.check()
        action_id: str | None = None
        if self._action_ids:
            if name is None:
                raise InvalidData("{what} is called without the name of its action (an=...)", what=what)
            action_id = self._action_ids.get(name)
            if action_id is None:
                raise InvalidData("{what}: the project has no action named {name!r}", what=what, name=name)
        points = self.points_of(arguments)
        branch = self.branches.current
        thread = None if branch is self.branches.main else threading.get_ident()
        calls = branch.calls
        frames = [call.frame for call in calls if call.frame is not None]
        frame = Frame(action_id or "")
        if frames:
            caller = frames[-1].action_id
            frame = Frame(frame.action_id, self._functions.get(caller, ""), caller)
        if calls and calls[-1].frame is None and action_id is not None:  # the call that the branch runs
            branch.id = action_id
        branch.device = device  # before the gate, so that a stop of the branch finds it
        data = ActionStateBeforeData(
            msgspec.UNSET if action_id is None else action_id,
            [encode_shown(argument) for argument in arguments] if arguments else msgspec.UNSET,
            points or msgspec.UNSET,
            msgspec.UNSET if thread is None else thread,
        )
        caller_number = calls[-1].number if calls else 0
        action = Action(next(self._numbers), action_id, caller_number, frame, attempt or ATTEMPT.get())
        encoded = _encode(Event("ActionStateBefore", data=data))
        self.channel.event(
            "ActionStateBefore",
            encoded,
            action.number,
            name or what,
            time.time(),
            device,
            call=action.call,
            frames=[*frames, frame],
            branch=branch.id,
            attempt=action.attempt,
        )
        announced = time.monotonic()
        # The action that uses a pose pauses at its action point, not the call that passes it on.
        ids = set() if is_call else points
        if attempt:
            self.gate.before_decided(branch)
        else:
            self.gate.before(branch, ids if action_id is None else ids | {action_id}, len(calls), is_call=is_call)
        if not is_call:
            self._hold_if_unusable(action, name or what)
        action.began = time.monotonic()
        action.waited = action.began - announced
        if is_call:
            calls.append(action)
        return action

    def action_ended(self, action: Action, value: Any) -> None:
        """Report the result of an action, then wait while the program is paused. Raises ProgramStopped."""
        self._report_end(action, value)
        self._leave(counted=action.failed_after is None)

    def _leave(self, *, counted: bool = True) -> None:
        branch = self.branches.current
        branch.device = ""
        self.gate.after(branch, counted=counted)

    def function_ended(self, call: Action, value: Any) -> None:
        """Report the result of a function."""
        self.branches.current.calls.pop()
        self._report_end(call, value)

    def function_failed(self, call: Action, error: BaseException) -> None:
        """Report that a function has failed. The failed action inside remains the cause of the error."""
        branch = self.branches.current
        branch.calls.pop()
        if branch.failure.action is None or branch.failure.action[0] is not error:
            branch.failure.action = error, call
        self.channel.action_over(call.number, time.monotonic() - call.began, message_of(error), call.waited)

    def _report_end(self, action: Action, value: Any) -> None:
        duration = time.monotonic() - action.began if action.failed_after is None else action.failed_after
        if action.id is None:
            self.channel.action_over(action.number, duration, None, action.waited)
        else:
            found = results(value)
            if found and self.record is not None:
                self.record.store_variables(action.id, found)
            data = ActionStateAfterData(action.id, found or msgspec.UNSET)
            encoded = _encode(Event("ActionStateAfter", data=data))
            self.channel.event(
                "ActionStateAfter", encoded, action.number, time=duration, waited=action.waited, call=action.call
            )

    def action_failed(self, action: Action, error: BaseException) -> None:
        """Report that an action has failed, then wait while the program is paused. Raises ProgramStopped."""
        self._report_failure(action, error)
        self._leave()

    def hold(
        self, action: Action, name: str, device: Device, method: Any, error: BaseException,
        check_done: Callable[[], None],
    ) -> Decision | None:  # fmt: skip
        """Hold the program because an action has failed, and return the decision; None if the error is to be raised.

        check_done: raises an error if the action cannot count as done by hand.

        Raises:
            ProgramStopped: The program was stopped.
            Arcor2Error: The decision is to end the program, or to take an error exit.
        """
        branch, call = self.branches.current, self._call_of(action, name)
        if self.recovery is None or self.stop_requested or branch.held or not self.recovery.holds(call, error):
            if action.attempt > ATTEMPT.get():
                mark_decided(error)
            return None
        if action.attempt == ATTEMPT.get() and RETRIES.get() and not isinstance(error, ENDS_PROGRAM):
            return None
        self._report_failure(action, error)
        action.failed_after = time.monotonic() - action.began
        decision = self.recovery.after_failure(branch, call, device, method, error, check_done)
        if decision.error is not None:
            branch.failure.action = decision.error, action
            self.record_error_source(device, decision.error)
            raise decision.error
        return decision

    def _hold_if_unusable(self, action: Action, name: str) -> None:
        """Hold the program before an action while a device cannot be used: lost, or without control."""
        branch = self.branches.current
        while self.recovery is not None and (found := self.recovery.before_action(branch, self._call_of(action, name))):
            if found.error is not None:
                branch.failure.action = found.error, action
                raise found.error
            self.gate.before_decided(branch)

    def _call_of(self, action: Action, name: str) -> ActionCall:
        around = (call.id or "" for call in reversed(self.branches.current.calls))
        return ActionCall(action.number, name, [action.id or "", *around])

    def _report_failure(self, action: Action, error: BaseException) -> None:
        self.branches.current.failure.action = error, action
        duration = time.monotonic() - action.began
        self.channel.action_over(action.number, duration, message_of(error), action.waited)

    def wait_to_start(self, seconds: float) -> float:
        """Wait in an action that an interlock prevents from starting; see `Gate.wait_to_start`."""
        return self.gate.wait_to_start(self.branches.current, seconds)

    def id_of(self, name: str | None) -> str:
        """Return the id of an action by its name; empty if the project has no such action."""
        return self._action_ids.get(name or "", "")

    def outcome_of(self, done: DoneAction, device: Device, method: Any) -> Any:
        """Return the stored result of an action of the interrupted program, or raise the error that it has handled."""
        self.check()
        try:
            return value_of(done, method)
        except Arcor2Error as error:
            self.record_error_source(device, error)
            raise

    def pause_before_retry(self, seconds: float) -> None:
        """Wait before an action is repeated. Raises ProgramStopped if the program is stopped."""
        main = self.in_main_thread
        if main:
            self.inside = True
        try:
            self.gate.sleep(self.branches.current, seconds)
        finally:
            if main:
                self.inside = False

    def record_error_source(self, device: Device, error: BaseException) -> None:
        """Record the device that raised an error, so that the report of the error names it."""
        self.branches.current.failure.device = error, device

    def caught(self, error: Arcor2Error) -> ActionError:
        """Return a description of the error, for the error exit of an action.

        Raises:
            Arcor2Error: The same error, if it always ends the program: a lost device, lost control, a safety stop or a
                cancelled action.
        """
        if isinstance(error, ENDS_PROGRAM):
            raise error
        source = self.source_of(error)
        return ActionError("" if source is None else source.name, error.code, str(error))

    def source_of(self, error: BaseException) -> Device | None:
        """Return the device that raised an error, None if no device did."""
        source = self.branches.current.failure.device
        return source[1] if source is not None and source[0] is error else None

    # -------------------------------------------------------------------------------- stop and end
    def stop(self) -> None:
        """Stop all devices while their calls run, then end the script."""
        self.stop_requested = True
        self._stops = self.cell.stop_all(ProgramStopped("the program was stopped"))
        self._stop_sent.set()
        self.cell.abandon()
        self.gate.stop()

    def device_lost(self, device: Device, reason: Message | None) -> bool:
        """Stop the program because the connection of a device is lost. Return whether the program was still running.

        A program that can be held continues, and is held before its next action.
        """
        if self.recovery is not None and self.recovery.active:
            why = reason or Message.of("unknown reason")
            lost = ConnectionLost("{name}: the connection is lost: {reason}", name=device.name, reason=why)
            self.recovery.hold_before_next(device, lost)
            return False
        error = ConnectionLost(
            "{name}: the program was stopped, because the connection is lost: {reason}",
            name=device.name,
            reason=reason or Message.of("unknown reason"),
        )
        with self._reporting:
            if self.ended or self.stop_requested or self.error is not None:
                return False
            self._device_lost = True
            described = describe(device, error)
            self.record_error_source(device, described)
            self._report_exception(described)
        self.stop()
        return True

    def settle(self, failed: bool) -> Arcor2Error | None:
        """Wait until all devices have stopped and return the error of the first that has not.

        failed: whether the program failed. The stops are sent then, so that no device keeps moving.
        """
        if self.stop_requested:
            self._stop_sent.wait(STOP_DEADLINE)  # the script may end before the stop is sent to the last device
        elif failed:
            self._stops = self.cell.stop_all()
        return wait_stopped(self._stops)

    def sent_stops(self) -> list[SentStop]:
        """Wait until the stops of the program are sent to all devices, and return them."""
        self._stop_sent.wait(STOP_DEADLINE)
        return self._stops

    def exception(self, error: BaseException) -> None:
        """Report the exception that ended the script, unless it was reported before."""
        with self._reporting:
            if self.error is not error and not self._device_lost:
                self._report_exception(error)

    def _report_exception(self, error: BaseException) -> None:
        self.error = error
        message = message_of(error)
        failure = self.branches.main.failure
        if failure.device is not None and failure.device[0] is error:
            message = describe(failure.device[1], error).message
        action_id: str | msgspec.UnsetType = msgspec.UNSET
        if failure.action is not None and failure.action[0] is error and failure.action[1].id is not None:
            action_id = failure.action[1].id
        data = ProjectExceptionData(
            message.text, type(error).__name__, isinstance(error, Arcor2Error), action_id, **message.translation()
        )
        self.channel.event("ProjectException", _encode(Event("ProjectException", data=data)))


_current: Program | None = None


def current() -> Program | None:
    """Return the program that this process runs for the server; None in a script started by hand."""
    return _current


def set_current(program: Program | None) -> None:
    """Set the program to which `Resources` belongs."""
    global _current
    _current = program
