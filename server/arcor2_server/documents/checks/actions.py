"""Checks of actions, their parameters, flows and results."""

from collections.abc import Iterator, Set
from typing import Final

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.actions.parameter_types import PARAMETER_TYPES
from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import Again, ObjectAction, ParameterMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import (
    CALL,
    ERROR_FLOW,
    ERROR_PARTS,
    MAX_RETRIES,
    MAX_RETRY_PAUSE,
    Action,
    ActionParameter,
    ActionParameterType,
    BareActionPoint,
    Flow,
    FlowTypes,
    NamedOrientation,
    ProjectFunction,
    ProjectRobotJoints,
    parse_link,
)
from arcor2_hw.data.project_index import ProjectLookup
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_server.documents.checks.branches import check_branches
from arcor2_server.documents.checks.names import check_name
from arcor2_server.documents.checks.object_types import Types
from arcor2_server.documents.document import OUTPUT, Document
from arcor2_server.documents.renamed_actions import with_present_name

_PARALLEL: Final = ObjectAction("parallel")
"""The metadata of an action that runs several calls concurrently."""


def check_action(action: Action, lookup: ProjectLookup, types: Types, function: ProjectFunction | None = None) -> None:
    """Raise InvalidData or NotFound for an invalid action. Whether its names are free is not checked.

    function: the function that contains the action; None for an action of the program.
    """
    meta = action_meta(action, lookup, types)
    check_flows(action, meta)
    check_retry(action, meta)
    check_branches(action, lookup)
    complete = complete_parameters(action, meta)
    check_parameters(complete, meta, lookup, types, function)
    if function is not None:
        check_recursion(action, function, lookup)


class _Unparented:
    """A lookup without the parents of action points, which are not needed to check references."""

    def __init__(self, lookup: ProjectLookup) -> None:
        self._lookup = lookup
        self.scene_object = lookup.scene_object
        self.action = lookup.action
        self.parameter = lookup.parameter
        self.find_function = lookup.find_function
        self.function_of = lookup.function_of

    def action_point(self, action_point_id: str) -> BareActionPoint:
        return replace(self._lookup.action_point(action_point_id), parent=UNSET)

    def orientation(self, orientation_id: str) -> tuple[BareActionPoint, NamedOrientation]:
        point, orientation = self._lookup.orientation(orientation_id)
        return replace(point, parent=UNSET), orientation

    def joints(self, joints_id: str) -> tuple[BareActionPoint, ProjectRobotJoints]:
        point, joints = self._lookup.joints(joints_id)
        return replace(point, parent=UNSET), joints


def action_meta(action: Action, lookup: ProjectLookup, types: Types) -> ObjectAction:
    """Return the metadata of an action.

    Raises:
        InvalidData: The action is malformed or disabled.
        NotFound: Its object or method does not exist.
    """
    return _action_meta(action, lookup, types, frozenset())


def _action_meta(action: Action, lookup: ProjectLookup, types: Types, callers: Set[str]) -> ObjectAction:
    if action.is_parallel:
        return _PARALLEL
    try:
        object_id, method = action.parse_type()
    except ValueError as error:
        raise InvalidData("{reason}.", reason=error) from None
    if method == CALL and (function := lookup.find_function(object_id)) is not None:
        return _function_meta(function, lookup, types, callers)
    obj = lookup.scene_object(object_id)
    meta = types.action(obj.type, method)
    if meta.disabled:
        shown, why = types.meta(obj.type).shown_name, meta.why_disabled
        raise InvalidData("{method} of {type} cannot be used ({reason}).", method=method, type=shown, reason=why)
    return meta


def _function_meta(function: ProjectFunction, lookup: ProjectLookup, types: Types, callers: Set[str]) -> ObjectAction:
    """Return the metadata of the calls of a function. Its parameters have the ranges and values of their first use."""
    parameters = []
    for parameter in function.parameters:
        use = _use_of(parameter.name, function, lookup, types, callers)
        extra = UNSET if use is None else use[1].extra
        parameters.append(ParameterMeta(parameter.name, parameter.type, extra=extra))
    return ObjectAction(CALL, parameters=parameters, returns=[result.type for result in function.returns])


def _use_of(
    name: str, function: ProjectFunction, lookup: ProjectLookup, types: Types, callers: Set[str]
) -> tuple[str, ParameterMeta] | None:
    """Return the object and the parameter of the first method that uses a parameter of a function, None if unused."""
    if function.id in callers:  # invalid recursion
        return None
    callers = {*callers, function.id}
    for action, parameter in uses_of_parameter(function, name):
        called, _, method = action.type.partition("/")
        try:
            meta = _action_meta(action, lookup, types, callers)
        except Arcor2Error:
            continue
        present = meta.present_name(parameter.name)
        declared = next((each for each in meta.parameters if each.name == present), None)
        inner = lookup.find_function(called) if method == CALL else None
        if inner is not None:
            if (use := _use_of(present, inner, lookup, types, callers)) is not None:
                return use
        elif declared is not None:
            return called, declared
    return None


def uses_of_parameter(function: ProjectFunction, name: str) -> Iterator[tuple[Action, ActionParameter]]:
    """Return the actions of a function that use one of its parameters, each with its own parameter."""
    for action in function.actions:
        for parameter in action.parameters:
            if parameter.type == ActionParameterType.FUNCTION_PARAMETER and text_of(parameter) == name:
                yield action, parameter


def check_recursion(action: Action, function: ProjectFunction, lookup: ProjectLookup) -> None:
    """Raise InvalidData if an action of a function calls this function, also through other functions."""
    seen: set[str] = set()
    waiting = [action]
    while waiting:
        called, _, method = waiting.pop().type.partition("/")
        if method != CALL or called in seen or (inner := lookup.find_function(called)) is None:
            continue
        if called == function.id:
            raise InvalidData(
                "{name}: the function {function} cannot call itself.", name=action.name, function=function.name
            )
        seen.add(called)
        waiting += inner.actions


def check_flows(action: Action, meta: ObjectAction) -> None:
    """Raise InvalidData for flows that do not fit the results of the action."""
    flows: list[Flow] = action.flows
    if [flow.type for flow in flows] != [FlowTypes.DEFAULT]:
        raise InvalidData("{name}: exactly one flow is needed, of type default.", name=action.name)
    outputs = flows[0].outputs
    for output in outputs:
        check_name(output, "result")
    if not isinstance(action.error_output, Unset):
        check_name(action.error_output, "error")
        if action.error_output in outputs:
            raise InvalidData("{name}: its error and a result have the same name.", name=action.name)
    if outputs and len(outputs) != len(meta.returns):
        raise InvalidData(
            "{name}: {meta_name} returns {count} values, {other_count} names are given.",
            name=action.name,
            meta_name=meta.name,
            count=len(meta.returns),
            other_count=len(outputs),
        )


def check_retry(action: Action, meta: ObjectAction) -> None:
    """Raise InvalidData for a retry with invalid values, or of an action that is not safe to repeat."""
    retry = action.retry
    if isinstance(retry, Unset):
        return
    if meta.meta.again != Again.SAFE:
        raise InvalidData(
            "{name}: {meta_name} cannot be retried, because repeating it may do harm.",
            name=action.name,
            meta_name=meta.name,
        )
    if not (1 <= retry.count <= MAX_RETRIES and 0.0 <= retry.pause <= MAX_RETRY_PAUSE):
        raise InvalidData(
            "{name}: a retry has a count from 1 to {count} and a pause of 0 to {pause} s.",
            name=action.name,
            count=MAX_RETRIES,
            pause=f"{MAX_RETRY_PAUSE:g}",
        )


def check_outputs_unique(document: Document, action: Action, function: str = "") -> None:
    """Raise InvalidData for a result name that another action of the program, or of the same function, uses.

    Results become variables. Actions of the program may store results in a project variable of the same name.
    function: the id of the function, empty for an action of the program.
    """
    for output in action.names():
        if document.variable(output) is not None:
            if function:
                raise InvalidData(
                    "{name}: only the program changes the variable {output}. Let the function return the result.",
                    name=action.name,
                    output=output,
                )
            if output in action.outputs():
                continue
        other = document.named(OUTPUT, output, function)
        if other is not None and other != action.id:
            raise InvalidData(
                "{name} names a result {output} already: choose another name.",
                name=document.action(other).name,
                output=output,
            )


def check_stored(document: Document, action: Action, meta: ObjectAction, function: str = "") -> None:
    """Raise InvalidData for a result that is stored in a variable of another type."""
    for output, kind in zip(action.outputs(), meta.returns, strict=False):
        variable = document.variable(output, function)
        if variable is not None and variable.type != kind:
            raise InvalidData(
                "{name}: the variable {output} is {type}, the result is {return_value}.",
                name=action.name,
                output=output,
                type=variable.type,
                return_value=kind,
            )


def complete_parameters(action: Action, meta: ObjectAction) -> Action:
    """Return the action with present names, and with default values for missing parameters.

    Raises:
        InvalidData: A parameter is unknown, duplicate, or missing without a default.
    """
    action = with_present_name(action, meta)
    given = {parameter.name: parameter for parameter in action.parameters}
    if len(given) != len(action.parameters):
        raise InvalidData("{name}: a parameter is given twice.", name=action.name)
    if unknown := given.keys() - {parameter.name for parameter in meta.parameters}:
        raise InvalidData(
            "{name}: {meta_name} has no parameter {unknown}.",
            name=action.name,
            meta_name=meta.name,
            unknown=", ".join(sorted(unknown)),
        )
    filled = list(action.parameters)
    for parameter in meta.parameters:
        if parameter.name in given:
            continue
        if isinstance(parameter.default_value, Unset):
            raise InvalidData(
                "{name}: the parameter {parameter_name} is missing.", name=action.name, parameter_name=parameter.name
            )
        filled.append(ActionParameter(parameter.name, parameter.type, parameter.default_value))
    return action if len(filled) == len(action.parameters) else replace(action, parameters=filled)


def check_parameters(
    action: Action, meta: ObjectAction, lookup: ProjectLookup, types: Types, function: ProjectFunction | None = None
) -> None:
    """Raise InvalidData for parameters that do not fit the method. None may be missing (see complete_parameters).

    function: the function that contains the action; None for an action of the program.
    """
    declared = {parameter.name: parameter for parameter in meta.parameters}
    object_id, method = action.parse_type()
    called = lookup.find_function(object_id) if method == CALL else None
    unparented = _Unparented(lookup)
    for parameter in action.parameters:
        wanted = declared[parameter.name]
        try:
            match parameter.type:
                case ActionParameterType.PROJECT_PARAMETER:
                    _check_project_parameter(parameter, wanted, lookup)
                case ActionParameterType.LINK:
                    _check_link(action, parameter, wanted, lookup, types, function)
                case ActionParameterType.FUNCTION_PARAMETER:
                    _check_function_parameter(parameter, wanted, function)
                case _ if wanted.type in PARAMETER_TYPES:
                    robot_id: str | None = object_id
                    if called is not None:
                        use = _use_of(wanted.name, called, lookup, types, frozenset())
                        robot_id = None if use is None else use[0]
                    PARAMETER_TYPES[wanted.type].check(parameter, wanted, unparented, robot_id)
                case _:
                    raise InvalidData(
                        "parameter {name} is of the unknown type {type}", name=wanted.name, type=wanted.type
                    )
        except Arcor2Error as error:
            raise InvalidData("{name}: {reason}", name=action.name, reason=error) from error


def text_of(parameter: Parameter) -> str:
    """Return the id, link or name to which a parameter refers. Raise InvalidData if its value is not a string."""
    try:
        return msgspec.json.decode(parameter.value, type=str)
    except msgspec.DecodeError:
        raise InvalidData(
            "parameter {name}: {value} is not a JSON string.", name=parameter.name, value=parameter.value[:80]
        ) from None


def _check_project_parameter(parameter: Parameter, wanted: ParameterMeta, lookup: ProjectLookup) -> None:
    source = lookup.parameter(text_of(parameter))
    if source.type != wanted.type:
        raise InvalidData(
            "parameter {name} is {type}, the project parameter {source_name} is {source_type}.",
            name=wanted.name,
            type=wanted.type,
            source_name=source.name,
            source_type=source.type,
        )


def _check_function_parameter(parameter: Parameter, wanted: ParameterMeta, function: ProjectFunction | None) -> None:
    name = text_of(parameter)
    source = next((each for each in function.parameters if each.name == name), None) if function is not None else None
    if source is None:
        raise InvalidData(
            "parameter {name}: there is no parameter {source} of a function here.", name=wanted.name, source=name
        )
    if source.type != wanted.type:
        raise InvalidData(
            "parameter {name} is {type}, the parameter {source_name} of the function is {source_type}.",
            name=wanted.name,
            type=wanted.type,
            source_name=source.name,
            source_type=source.type,
        )


def _check_link(
    action: Action,
    parameter: Parameter,
    wanted: ParameterMeta,
    lookup: ProjectLookup,
    types: Types,
    function: ProjectFunction | None,
) -> None:
    try:
        source_id, flow, index = parse_link(text_of(parameter))
    except ValueError as error:
        raise InvalidData("parameter {name}: {reason}.", name=wanted.name, reason=error) from None
    if source_id == action.id:
        raise InvalidData("parameter {name} cannot be linked to a result of the same action.", name=wanted.name)
    source = lookup.action(source_id)
    if lookup.function_of(source_id) != ("" if function is None else function.id):
        raise InvalidData(
            "parameter {name}: {source_name} is an action of another function, or of the program.",
            name=wanted.name,
            source_name=source.name,
        )
    returns, outputs = action_meta(source, lookup, types).returns, source.outputs()
    if flow == ERROR_FLOW:
        _check_link_to_error(wanted, source, index)
        return
    if flow != FlowTypes.DEFAULT or len(outputs) != len(returns) or index >= len(returns):
        raise InvalidData(
            "parameter {name}: {source_name} has no named result number {index}. Name its results.",
            name=wanted.name,
            source_name=source.name,
            index=index,
        )
    if returns[index] != wanted.type:
        raise InvalidData(
            "parameter {name} is {type}, the result {output} is {return_value}.",
            name=wanted.name,
            type=wanted.type,
            output=outputs[index],
            return_value=returns[index],
        )


def _check_link_to_error(wanted: ParameterMeta, source: Action, index: int) -> None:
    if not source.error_output or index >= len(ERROR_PARTS):
        raise InvalidData(
            "parameter {name}: the error of {source_name} has no name, or no part number {index}.",
            name=wanted.name,
            source_name=source.name,
            index=index,
        )
    if wanted.type != "string":
        raise InvalidData(
            "parameter {name} is {type}, the parts of an error are string.", name=wanted.name, type=wanted.type
        )
