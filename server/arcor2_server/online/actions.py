"""Execution of a single action in the online scene."""

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
from arcor2_server.errors import RequestRefused

log = structlog.get_logger(__name__)


class LastStop:
    """The time at which everything was last stopped. Motion requested before does not start."""

    def __init__(self) -> None:
        self._at = -math.inf

    def note(self) -> None:
        """Note that everything is being stopped now."""
        self._at = time.monotonic()

    def require_none_since(self, moment: float | None) -> None:
        """Raise Cancelled if everything was stopped since `moment`, s of the monotonic clock; None: never raise."""
        if moment is not None and self._at >= moment:
            raise Cancelled("It was stopped before it started.")


class RunningAction:
    """The action that is being executed."""

    def __init__(self, action_id: str, object_id: str, method: str, requested_at: float) -> None:
        self.action_id = action_id
        self.object_id = object_id
        self.method = method
        self.requested_at = requested_at
        self.cancelled = False
        self.stop_requested = False
        """Everything was stopped while it ran: the scene may go offline even if the action does not return."""


class PreparedAction(Data, frozen=True):
    """The resolved call of an action."""

    action_id: str
    object_id: str
    method: str
    arguments: dict[str, Any]
    returns: int


def argument(parameter: ActionParameter, lookup: ProjectLookup, results: dict[str, list[str]]) -> Any:
    """Return the value of a parameter at execution. RequestRefused for a link without a result.

    Raise InvalidData if that is impossible.
    """
    if parameter.type == ActionParameterType.LINK:
        try:
            action_id, _, index = parse_link(read_reference(parameter))
        except ValueError as error:
            raise InvalidData("parameter {name}: {reason}", name=parameter.name, reason=error) from error
        stored = results.get(action_id)
        if stored is None or index >= len(stored):
            name = lookup.action(action_id)[1].name
            raise RequestRefused(
                "Parameter {name} needs a result of the action {other_name}: execute that first.",
                name=parameter.name,
                other_name=name,
            )
        return msgspec.Raw(stored[index].encode())
    if parameter.type == ActionParameterType.PROJECT_PARAMETER:
        return msgspec.Raw(lookup.parameter(read_reference(parameter)).value.encode())
    return parameter_type(parameter.type).value(parameter, lookup)


def prepare(action: Action, meta: ObjectAction, lookup: ProjectLookup, results: dict[str, list[str]]) -> PreparedAction:
    """Work out the call of an action. RequestRefused, InvalidData, NotFound say what is missing."""
    try:
        object_id, method = action.parse_type()
    except ValueError as error:
        raise InvalidData(str(error)) from error
    arguments = {parameter.name: argument(parameter, lookup, results) for parameter in action.parameters}
    return PreparedAction(action.id, object_id, method, arguments, len(meta.returns))


def split_results(raw: bytes, returns: int) -> list[str]:
    """Return the results of a call as the protocol lists them."""
    if not raw:
        return []
    if returns > 1:
        return [bytes(part).decode() for part in msgspec.json.decode(raw, type=list[msgspec.Raw])]
    return [raw.decode()]


class ActionScene(Protocol):
    """The online scene, as far as the execution of one action needs it."""

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

    def action_ended(self, action: RunningAction, results: list[str] | None, error: str | None) -> None:
        """Take over the end of an action."""


async def execute(scene: ActionScene, prepared: PreparedAction, running: RunningAction) -> None:
    """Call the method of an action and report how it ended."""
    results: list[str] | None = None
    error: str | None = None
    try:
        raw = await scene.call(
            prepared.object_id, prepared.method, prepared.arguments, control=True, requested_at=running.requested_at
        )
        results = split_results(raw, prepared.returns)
    except Arcor2Error as caught:
        error = str(caught)
        log.info("action failed", action=prepared.action_id, reason=error, detail=caught.detail)
    except msgspec.MsgspecError as caught:
        error = f"The action gave something else than it declares: {caught}"
    finally:
        scene.action_ended(running, results, error)
