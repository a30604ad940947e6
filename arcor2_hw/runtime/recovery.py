"""Holds a program at an action that failed, until a person decides how it continues."""

import enum
import typing
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import msgspec

from arcor2_hw.actions import metadata_of
from arcor2_hw.actions.json_values import decode_json, encode
from arcor2_hw.data.base import UNSET, now
from arcor2_hw.data.device import Connection
from arcor2_hw.data.held import HeldData, HoldChoice, HoldExit, ResultType
from arcor2_hw.data.object_type import Again
from arcor2_hw.data.project import Action, LogicItem, Project
from arcor2_hw.exceptions import (
    ENDS_PROGRAM,
    ERROR_KINDS,
    Arcor2Error,
    Conflict,
    InvalidData,
    NotConnected,
    ProgramInterrupted,
    WrongPart,
    message_of,
)
from arcor2_hw.messages import Message
from arcor2_hw.runtime.branches import Branch
from arcor2_hw.runtime.cell import CONTROL_DEADLINE, Cell
from arcor2_hw.runtime.device import Device, describe
from arcor2_hw.runtime.ledger import PartGone
from arcor2_hw.runtime.messages import DecideHeld
from arcor2_hw.runtime.methods import overrides
from arcor2_hw.runtime.pacing import Gate
from arcor2_hw.runtime.stopping import send_stop, wait_stopped
from arcor2_hw.runtime.values import return_hint

_SIMPLE: Final = {bool: "boolean", int: "integer", float: "double", str: "string"}
_GONE: Final = (Connection.LOST, Connection.FAILED)
_DECIDED: Final = "_arcor2_decided"
Post = Callable[[HeldData, Device, BaseException], None]


class Decision(NamedTuple):
    """A decision: `value` is the result of the action, `error` the error to raise."""

    choice: HoldChoice
    value: Any = None
    error: BaseException | None = None


class _Hold(NamedTuple):
    """The present hold.

    hints: types of the results. check_done: raises an error if the action cannot count as done. choices: all
    choices that the action allows.
    """

    data: HeldData
    device: Device
    error: BaseException
    hints: Sequence[Any]
    check_done: Callable[[], None] = lambda: None
    choices: Sequence[HoldChoice] = ()


class ActionCall(NamedTuple):
    """A call of an action: its number, name, its id followed by those of the calls of functions around it."""

    number: int
    name: str
    ids: Sequence[str]


def mark_decided(error: BaseException) -> None:
    """Record that an error is raised after a decision."""
    vars(error)[_DECIDED] = True


def is_decided(error: BaseException) -> bool:
    """Return whether an error is raised after a decision, so that the action is not retried automatically."""
    return bool(vars(error).get(_DECIDED))


class Recovery:
    """Decides whether the failure of an action holds the program, and waits for the decision.

    Without logic in the project, the handled errors are unknown, so the program is never held.

    Args:
        gate: holds the threads of the script.
        cell: the devices.
        settle: waits until no device moves.
        post: sends the data of a hold for clients, with its device and error; called while the gate is locked.
    """

    def __init__(self, gate: Gate, cell: Cell, settle: Callable[[], object], post: Post) -> None:
        self._gate, self._cell, self._settle, self._post = gate, cell, settle, post
        self.active = False
        self._actions: dict[str, Action] = {}
        self._exits: dict[str, list[LogicItem]] = {}
        self._used: set[str] = set()
        self._unusable: dict[str, tuple[Device, BaseException]] = {}
        self._uncontrolled: set[str] = set()
        self._present: _Hold | None = None
        self._decisions: dict[int, Decision] = {}
        """Decisions that have not taken effect, by the number of the action: the next hold may begin before."""

    def load(self, project: Project) -> None:
        """Read the error exits of the project, and the results that it uses."""
        self._actions = {action.id: action for action in project.all_actions()}
        self.active = project.has_logic and bool(self._actions)
        items = [*project.logic, *(item for each in project.functions for item in each.logic)]
        for item in items:
            if item.is_error_exit:
                self._exits.setdefault(item.start.partition("/")[0], []).append(item)
        self._used = {key for item in items for key in item.used()}
        self._used |= {key for key, action in self._actions.items() if any(action.outputs())}

    # -------------------------------------------------------------------------------- failures
    def holds(self, call: ActionCall, error: BaseException) -> bool:
        """Return whether an error holds the program, because no error exit handles it."""
        if not self.active or not isinstance(error, Exception):
            return False
        if isinstance(error, ENDS_PROGRAM):
            return True
        items = (item for key in call.ids for item in self._exits.get(key, ()))
        kinds = (kind for item in items for kind in item.error_kinds or ())
        return not any(isinstance(error, ERROR_KINDS[kind]) for kind in kinds if kind in ERROR_KINDS)

    def after_failure(
        self, branch: Branch, call: ActionCall, device: Device, method: Any, error: BaseException,
        check_done: Callable[[], None],
    ) -> Decision:  # fmt: skip
        """Hold the program at an action that has failed, and return the decision. The action no longer counts.

        check_done: raises an error if the action cannot count as done by hand.

        Raises:
            ProgramStopped: the program was stopped.
        """
        if device.busy_with or device.moving:
            wait_stopped([send_stop(device)])
        self._settle()
        found = metadata_of(method)
        again = Again.ASK if found is None or found.again is UNSET else Again(found.again)
        hints = _members(return_hint(method))
        types = [_result_type(hint) for hint in hints]
        known = [one for one in types if one is not None]
        exits = next((self._exits[key] for key in call.ids if key in self._exits), [])
        used = call.ids[0] in self._used or (found is not None and found.verdict is True)
        choices = {
            HoldChoice.RETRY: again is not Again.NEVER,
            HoldChoice.RESULT: bool(hints) and used and len(known) == len(types),
            HoldChoice.SKIP: not hints or not used,
            HoldChoice.ERROR_EXIT: bool(exits),
            HoldChoice.END: True,
        }
        data = self._data(call, device, error, [choice for choice, offered in choices.items() if offered])
        data = msgspec.structs.replace(
            data,
            again=again if choices[HoldChoice.RETRY] else UNSET,
            returns=known if choices[HoldChoice.RESULT] else UNSET,
            exits=[self._exit(item) for item in exits] or UNSET,
        )
        return self._wait(branch, _Hold(data, device, error, hints, check_done, data.choices))

    def hold_before_next(self, device: Device, error: BaseException) -> None:
        """Hold the program before the next action, because a connection is lost or a device refuses control."""
        self._unusable[device.id] = (device, error)

    def before_action(self, branch: Branch, call: ActionCall) -> Decision | None:
        """Hold the program before an action if a device cannot be used; return the decision."""
        for device, error in list(self._unusable.values()):
            data = self._data(call, device, error, [HoldChoice.RETRY, HoldChoice.END])
            return self._wait(branch, _Hold(msgspec.structs.replace(data, before=True), device, error, ()))
        return None

    def take_control(self, device: Device) -> None:
        """Take control of a device before its first action after a hold, unless this process has it."""
        if device.id in self._uncontrolled:
            if overrides(device.recipe.cls, "take_control"):
                device.lane.call("take_control", device.take_control, deadline=CONTROL_DEADLINE)
            self._uncontrolled.discard(device.id)

    def _data(self, call: ActionCall, device: Device, error: BaseException, choices: list[HoldChoice]) -> HeldData:
        message = error.message if isinstance(error, ProgramInterrupted) else describe(device, error).message
        code = error.code if isinstance(error, Arcor2Error) else "error"
        return HeldData(
            0, call.number, call.ids[0], call.name, device.id, code, message.text, choices, now(),
            **message.translation(),
        )  # fmt: skip

    def _exit(self, item: LogicItem) -> HoldExit:
        following = self._actions.get(item.end.partition("/")[0])
        return HoldExit(item.id, list(item.error_kinds or ()), "" if following is None else following.name)

    def _wait(self, branch: Branch, hold: _Hold) -> Decision:
        def begin() -> None:
            self._present = hold
            self._post(hold.data, hold.device, hold.error)

        try:
            self._gate.hold_program(branch, begin)
        finally:
            present = self._present
            if present is not None and present.data.number == hold.data.number:  # the program or the branch was stopped
                self._present = None
        decision = self._decisions.pop(hold.data.number)
        self._uncontrolled = {device.id for device in self._cell}
        if decision.error is not None:
            mark_decided(decision.error)
        return decision

    # -------------------------------------------------------------------------------- decisions
    def without_part(self) -> HeldData | None:
        """Return the hold without the choices that need a part which has left the cell; None if nothing changes."""
        hold = self._present
        if hold is None:
            return None
        choices = list(hold.choices)
        try:
            hold.check_done()
        except PartGone:
            choices = [choice for choice in choices if choice not in (HoldChoice.SKIP, HoldChoice.RESULT)]
        except WrongPart:  # the part can still be brought to its place
            return None
        if not hold.choices or choices == hold.data.choices:
            return None
        self._present = hold._replace(data=msgspec.structs.replace(hold.data, choices=choices))
        return self._present.data

    def decide(self, message: DecideHeld) -> None:
        """Accept a decision about the held program. It continues after `release`.

        Raises:
            Conflict: the program is not held at this action.
            InvalidData: this is not one of the choices, or the results are not valid.
            NotConnected: the connection of the device is lost.
            WrongPart: the part is not at the target of the action.
        """
        hold, choice = self._present, message.choice
        if hold is None or hold.data.number != message.number:
            raise Conflict("The program is not held at this action.")
        if choice not in hold.data.choices:
            raise InvalidData("{choice} is not possible here. Choices: {choices}.", choice=choice.value,
                              choices=", ".join(hold.data.choices))  # fmt: skip
        decision = Decision(choice)
        match choice:
            case HoldChoice.RETRY:
                _require_connected(hold.device)
            case HoldChoice.SKIP:
                hold.check_done()
            case HoldChoice.RESULT:
                hold.check_done()
                decision = Decision(choice, _decoded(hold, message.results))
            case HoldChoice.ERROR_EXIT:
                decision = Decision(choice, error=self._forced(hold, message.exit_id))
            case HoldChoice.END:
                decision = Decision(choice, error=hold.error)
        # Before the release: another branch, which checks it before its next action, may continue first.
        self._unusable.pop(hold.device.id, None)
        self._present, self._decisions[message.number] = None, decision

    def release(self) -> None:
        """Let the program continue after a decision."""
        self._gate.release()

    def _forced(self, hold: _Hold, exit_id: str) -> Arcor2Error:
        """Return the error of a hold, with its code, as an error that the exit catches."""
        exits = hold.data.exits or []
        found = next((one for one in exits if exit_id in ("", one.id)), None)
        if found is None:
            raise InvalidData("The action has no error exit {id}.", id=exit_id)
        forced = ERROR_KINDS[found.kinds[0]](message_of(hold.error))
        vars(forced)["code"] = hold.data.kind
        forced.__cause__ = hold.error
        return forced


def _require_connected(device: Device) -> None:
    if device.require().connection in _GONE:
        raise NotConnected(
            "{name} is not connected: {reason}",
            name=device.name,
            reason=device.connection_reason() or Message.of("unknown reason"),
        )


def _members(hint: Any) -> Sequence[Any]:
    """Return the types of the results of a method by its hint: none, one, or the members of a tuple."""
    if hint is None or hint is type(None):
        return ()
    if typing.get_origin(hint) is tuple:
        return typing.get_args(hint)
    return (hint,)


def _result_type(hint: Any) -> ResultType | None:
    """Return the type of a result that a person can supply, None for any other type."""
    if not isinstance(hint, type):
        return None
    if issubclass(hint, enum.Enum):
        kind = "string_enum" if issubclass(hint, str) else "integer_enum" if issubclass(hint, int) else ""
        return ResultType(kind, [encode(one.value) for one in hint]) if kind else None
    kind = _SIMPLE.get(hint, "")
    return ResultType(kind) if kind else None


def _decoded(hold: _Hold, results: Sequence[str]) -> Any:
    """Return the value of the action for results in JSON. Raises InvalidData."""
    if len(results) != len(hold.hints):
        raise InvalidData(
            "{action} has {expected} results, not {count}.",
            action=hold.data.action_name,
            expected=len(hold.hints),
            count=len(results),
        )
    return _values(results, hold.hints)


def decode_results(method: Any, results: Sequence[str]) -> Any:
    """Return the value of an action for its stored results. Raises InvalidData."""
    return _values(results, _members(return_hint(method)))


def _values(results: Sequence[str], hints: Sequence[Any]) -> Any:
    values = [decode_json(text, hint) for text, hint in zip(results, hints, strict=True)]
    return values[0] if len(values) == 1 else tuple(values)
