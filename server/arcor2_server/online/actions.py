"""Executes single actions in the online scene."""

import math
import time
from collections.abc import Mapping
from typing import Any, Protocol

import msgspec
import structlog

from arcor2_hw.actions.parameter_types import parameter_type, read_reference
from arcor2_hw.data.base import Data
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.project import Action, ActionParameter, ActionParameterType, parse_link
from arcor2_hw.data.project_index import ProjectLookup
from arcor2_hw.exceptions import Arcor2Error, Cancelled, InvalidData
from arcor2_hw.messages import Message
from arcor2_server.errors import RequestRefused

log = structlog.get_logger(__name__)


class LastStop:
    """The time of the last StopAll. Motion requested before it does not start."""

    def __init__(self) -> None:
        self._at = -math.inf

    def note(self) -> None:
        """Store that everything is being stopped now."""
        self._at = time.monotonic()

    def require_none_since(self, moment: float | None) -> None:
        """Raise Cancelled if everything was stopped since `moment`, s of the monotonic clock. Ignore None."""
        if moment is not None and self._at >= moment:
            raise Cancelled("Stopped before it started.")


class RunningAction:
    """The action that is being executed."""

    def __init__(self, action_id: str, object_id: str, method: str, requested_at: float) -> None:
        self.action_id = action_id
        self.object_id = object_id
        self.method = method
        self.requested_at = requested_at
        self.cancelled = False
        self.stop_requested = False
        """Whether everything was stopped during the action. Then the scene may go offline before the action returns."""


class PreparedAction(Data, frozen=True):
    """The method call of an action. `returns` is the number of its results."""

    action_id: str
    object_id: str
    method: str
    arguments: dict[str, Any]
    returns: int


def argument(parameter: ActionParameter, lookup: ProjectLookup, results: dict[str, list[str]]) -> Any:
    """Return the value of a parameter.

    Args:
        parameter: the parameter.
        lookup: the items of the project.
        results: results of executed actions by action id, as JSON.

    Raises:
        RequestRefused: the parameter links to an action that has not been executed.
        InvalidData: the parameter is invalid.
    """
    if parameter.type == ActionParameterType.LINK:
        try:
            action_id, _, index = parse_link(read_reference(parameter))
        except ValueError as error:
            raise InvalidData("parameter {name}: {reason}", name=parameter.name, reason=error) from error
        stored = results.get(action_id)
        if stored is None or index >= len(stored):
            name = lookup.action(action_id).name
            raise RequestRefused(
                "Parameter {name} needs a result of the action {other_name}: execute that action first.",
                name=parameter.name,
                other_name=name,
            )
        return msgspec.Raw(stored[index].encode())
    if parameter.type == ActionParameterType.PROJECT_PARAMETER:
        return msgspec.Raw(lookup.parameter(read_reference(parameter)).value.encode())
    if parameter.type == ActionParameterType.FUNCTION_PARAMETER:
        raise RequestRefused(
            "Parameter {name} is a parameter of the function. Run the project to execute it.", name=parameter.name
        )
    return parameter_type(parameter.type).value(parameter, lookup)


def prepare(action: Action, meta: ObjectAction, lookup: ProjectLookup, results: dict[str, list[str]]) -> PreparedAction:
    """Return the method call of an action. Raise the errors of `argument`, and NotFound if a reference is missing."""
    try:
        object_id, method = action.parse_type()
    except ValueError as error:
        raise InvalidData("{reason}", reason=error) from error
    arguments = {parameter.name: argument(parameter, lookup, results) for parameter in action.parameters}
    return PreparedAction(action.id, object_id, method, arguments, len(meta.returns))


def split_results(raw: bytes, returns: int) -> list[str]:
    """Return the results of a call as a list of JSON values."""
    if not raw:
        return []
    if returns > 1:
        return [bytes(part).decode() for part in msgspec.json.decode(raw, type=list[msgspec.Raw])]
    return [raw.decode()]


class ActionScene(Protocol):
    """The methods of the online scene that the execution of an action needs."""

    async def call(
        self,
        object_id: str,
        method: str,
        args: Mapping[str, Any] | None = None,
        *,
        control: bool = False,
        deadline: float | None = None,
        requested_at: float | None = None,
    ) -> bytes:
        """Call a method of an object; return the result as JSON."""

    def action_ended(self, action: RunningAction, results: list[str] | None, error: Message | None) -> None:
        """Handle the end of an action."""


async def execute(scene: ActionScene, prepared: PreparedAction, running: RunningAction) -> None:
    """Call the method of an action and report its end."""
    results: list[str] | None = None
    error: Message | None = None
    try:
        raw = await scene.call(
            prepared.object_id, prepared.method, prepared.arguments, control=True, requested_at=running.requested_at
        )
        results = split_results(raw, prepared.returns)
    except Arcor2Error as caught:
        error = caught.message
        log.info("action failed", action=prepared.action_id, reason=error.text, detail=caught.detail)
    except msgspec.MsgspecError as caught:
        error = Message.of("The results of the action do not have the declared types: {reason}", reason=caught)
    finally:
        scene.action_ended(running, results, error)
