"""Changes of the parameters and results of a function, with its actions and its calls."""

from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import (
    ERROR_FLOW,
    Action,
    ActionParameter,
    FlowTypes,
    FunctionReturns,
    ProjectFunction,
    parse_link,
)
from arcor2_hw.exceptions import NotFound
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.checks.actions import uses_of_parameter
from arcor2_server.documents.checks.functions import type_of_result
from arcor2_server.documents.checks.object_types import Types
from arcor2_server.documents.document import Document
from arcor2_server.documents.function_links import Names, changes_of_users, encoded, used_by
from arcor2_server.errors import RequestRefused


def _bare(function: ProjectFunction) -> ProjectFunction:
    return replace(function, actions=[], logic=[])


def _updated(document: Document, function: ProjectFunction) -> Change:
    return document.update(Kind.FUNCTION, function.id, _bare(function))


# ---------------------------------------------------------------------------------------------- parameters
def _index(function: ProjectFunction, name: str) -> int:
    for index, parameter in enumerate(function.parameters):
        if parameter.name == name:
            return index
    raise NotFound("The function {function} has no parameter {name}.", function=function.name, name=name)


def add_parameter(document: Document, function_id: str, name: str, kind: str, value: Parameter | Unset) -> list[Change]:
    """Return the changes that add a parameter. `value`: the parameter of the present calls.

    Raises:
        RequestRefused: the function has calls, but there is no value for them.
        NotFound: the function does not exist.
    """
    function = document.function(function_id)
    calls = document.calls_of(function_id)
    if calls and isinstance(value, Unset):
        raise RequestRefused(
            "{call} calls the function {name}: state the value of the new parameter for its calls.",
            call=calls[0].name,
            name=function.name,
        )
    declared = [*function.parameters, ActionParameter(name, kind, "")]
    changes = [_updated(document, replace(function, parameters=declared))]
    if not isinstance(value, Unset):
        given = ActionParameter(name, value.type, value.value)
        changes += [
            document.update(Kind.ACTION, call.id, replace(call, parameters=[*call.parameters, given])) for call in calls
        ]
    return changes


def update_parameter(
    document: Document,
    function_id: str,
    name: str,
    new_name: str | Unset,
    kind: str | Unset,
    value: Parameter | Unset,
) -> list[Change]:
    """Return the changes that rename a parameter, change its type, or its value in the present calls.

    Raises:
        NotFound: the function or the parameter does not exist.
    """
    function = document.function(function_id)
    index = _index(function, name)
    wanted = name if isinstance(new_name, Unset) else new_name
    declared = list(function.parameters)
    declared[index] = ActionParameter(wanted, declared[index].type if isinstance(kind, Unset) else kind, "")
    changes = [_updated(document, replace(function, parameters=declared))]
    if wanted != name:
        for action in {action.id: action for action, _ in uses_of_parameter(function, name)}.values():
            own = {parameter.name for user, parameter in uses_of_parameter(function, name) if user.id == action.id}
            parameters = [replace(one, value=encoded(wanted)) if one.name in own else one for one in action.parameters]
            changes.append(document.update(Kind.ACTION, action.id, replace(action, parameters=parameters)))
    for call in document.calls_of(function_id):
        parameters = [_given(one, name, wanted, value) for one in call.parameters]
        if parameters != call.parameters:
            changes.append(document.update(Kind.ACTION, call.id, replace(call, parameters=parameters)))
    return changes


def _given(parameter: ActionParameter, name: str, wanted: str, value: Parameter | Unset) -> ActionParameter:
    if parameter.name != name:
        return parameter
    source = parameter if isinstance(value, Unset) else value
    return ActionParameter(wanted, source.type, source.value)


def remove_parameter(document: Document, function_id: str, name: str) -> list[Change]:
    """Return the changes that remove a parameter from a function and its calls.

    Raises:
        RequestRefused: an action of the function uses it.
        NotFound: the function or the parameter does not exist.
    """
    function = document.function(function_id)
    index = _index(function, name)
    for action, _ in uses_of_parameter(function, name):
        raise RequestRefused(
            "{action} uses the parameter {name}. Change {action} first.", action=action.name, name=name
        )
    declared = [*function.parameters[:index], *function.parameters[index + 1 :]]
    changes = [_updated(document, replace(function, parameters=declared))]
    for call in document.calls_of(function_id):
        parameters = [one for one in call.parameters if one.name != name]
        changes.append(document.update(Kind.ACTION, call.id, replace(call, parameters=parameters)))
    return changes


# ---------------------------------------------------------------------------------------------- results
def _require_index(function: ProjectFunction, index: int) -> None:
    if not 0 <= index < len(function.returns):
        raise NotFound("The function {function} has no result number {index}.", function=function.name, index=index)


def _result(document: Document, types: Types, function: ProjectFunction, link: str) -> FunctionReturns:
    result = FunctionReturns("", link)
    return replace(result, type=type_of_result(function, result, document, types))


def _with_outputs(action: Action, outputs: list[str]) -> Action:
    flows = [replace(flow, outputs=outputs) if flow.type is FlowTypes.DEFAULT else flow for flow in action.flows]
    return replace(action, flows=flows)


def add_result(document: Document, types: Types, function_id: str, link: str) -> list[Change]:
    """Return the changes that add a result. Calls that name results name it, too.

    Raises:
        InvalidData: `link` is not a named result of an action of the function.
        NotFound: the function does not exist.
    """
    function = document.function(function_id)
    result = _result(document, types, function, link)
    changes = [_updated(document, replace(function, returns=[*function.returns, result]))]
    source, _, index = parse_link(link)
    name = next(action for action in function.actions if action.id == source).outputs()[index]
    names: dict[str, Names] = {}
    for call in document.calls_of(function_id):
        if call.outputs() or not function.returns:
            scope = document.function_of(call.id)
            free = names.setdefault(scope, Names(document, scope)).output(name)
            outputs = [*call.outputs(), free]
            changes.append(document.update(Kind.ACTION, call.id, _with_outputs(call, outputs)))
    return changes


def update_result(document: Document, types: Types, function_id: str, index: int, link: str) -> list[Change]:
    """Return the changes that replace a result.

    Raises:
        InvalidData: `link` is not a named result of an action of the function.
        NotFound: the function or the result does not exist.
    """
    function = document.function(function_id)
    _require_index(function, index)
    returns = list(function.returns)
    returns[index] = _result(document, types, function, link)
    return [_updated(document, replace(function, returns=returns))]


def remove_result(document: Document, function_id: str, index: int) -> list[Change]:
    """Return the changes that remove a result from a function and its calls.

    Raises:
        RequestRefused: a link, a condition or another function uses it.
        NotFound: the function or the result does not exist.
    """
    function = document.function(function_id)
    _require_index(function, index)
    returns = [*function.returns[:index], *function.returns[index + 1 :]]
    changes = [_updated(document, replace(function, returns=returns))]
    calls = document.calls_of(function_id)
    for call in calls:
        for user in document.users_of(call.id):
            if (call.id, FlowTypes.DEFAULT, index) in used_by(user):
                raise RequestRefused(
                    "Result number {index} of {call} is used by {user}. Change {user} first.",
                    index=index,
                    call=call.name,
                    user=getattr(user, "name", "a condition"),
                )
    ids = {call.id for call in calls}

    def shifted(link: tuple[str, str, int]) -> str | None:
        key, flow, number = link
        return f"{key}/{flow}/{number - 1}" if key in ids and flow != ERROR_FLOW and number > index else None

    users = changes_of_users(document, [call.id for call in calls], shifted)
    of_call = {change.id: change for change in users if change.id in ids and change.kind is Kind.ACTION}
    changes += [change for change in users if change.id not in of_call]
    for call in calls:
        present: Action = of_call[call.id].after if call.id in of_call else call
        if outputs := call.outputs():
            present = _with_outputs(present, [*outputs[:index], *outputs[index + 1 :]])
        if present != call:
            changes.append(document.update(Kind.ACTION, call.id, present))
    return changes
