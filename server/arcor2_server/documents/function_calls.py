"""Dissolves calls into the actions of their function."""

from collections.abc import Sequence

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import new_id
from arcor2_hw.data.project import (
    END,
    START,
    Action,
    ActionParameter,
    ActionParameterType,
    FlowTypes,
    FunctionReturns,
    LogicItem,
    ProjectFunction,
    parse_link,
)
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.checks.actions import text_of
from arcor2_server.documents.document import Document
from arcor2_server.documents.function_links import Names, changes_of_users, with_condition, with_links
from arcor2_server.documents.item_indexes import action_of, reference
from arcor2_server.documents.parallel_work import mapped_branches
from arcor2_server.errors import RequestRefused


def dissolve_call(document: Document, call_id: str, *, remove_function: bool = False) -> tuple[list[Change], list[str]]:
    """Return the changes that replace a call by copies of the actions of its function, and the ids of the copies.

    Args:
        document: the open document.
        call_id: the action that calls the function.
        remove_function: whether to remove the function, which must have no other call. The copies keep the names.

    Raises:
        RequestRefused: the action is not a call, or it cannot be dissolved.
        NotFound: the action does not exist.
    """
    call = document.action(call_id)
    item = document.find(Kind.ACTION, call_id)
    assert item is not None
    function = document.find_function(call.type.partition("/")[0])
    if (owner := document.parallel_of(call_id)) is not None:
        raise RequestRefused(
            "{owner} runs {name} in parallel. Dissolve {owner} first.", name=call.name, owner=owner.name
        )
    if function is None:
        raise RequestRefused("{name} does not call a function.", name=call.name)
    if remove_function and len(document.calls_of(function.id)) > 1:
        raise RequestRefused("Other actions call {name}, so it cannot be removed.", name=function.name)
    scope = document.function_of(call_id)
    leaving = document.outgoing(call_id)
    if any(step.is_error_exit for step in leaving):
        raise RequestRefused("{name} has error exits. Remove them first.", name=call.name)
    starts = [action_of(step.end) for step in function.logic if action_of(step.start) == START]
    if len(starts) != 1:
        raise RequestRefused("The function {name} has no first action.", name=function.name)
    ids = {action.id: new_id("act") for action in function.actions}
    copies = _Copies(document, function, call, ids, remove_function=remove_function)

    def of_copy(link: tuple[str, str, int]) -> str | None:
        if link[0] != call_id or link[1] != FlowTypes.DEFAULT:
            return None
        source, flow, index = parse_link(function.returns[link[2]].link)
        return f"{ids[source]}/{flow}/{index}"

    without = frozenset(step.id for step in leaving)
    changes: list[Change] = []
    for action in copies.actions:
        parent = scope or _point_of(document, action) or item.parent
        changes.append(document.add(Kind.ACTION, action.id, action, parent))
    changes += changes_of_users(document, [call_id], of_copy, without)
    for step in document.incoming(call_id):
        changes.append(document.update(Kind.LOGIC, step.id, replace(step, end=ids[starts[0]])))
    changes += [document.remove(Kind.LOGIC, step.id) for step in leaving]
    following = [with_condition(step, of_copy) for step in leaving]
    for step in copies.logic(following):
        changes.append(document.add(Kind.LOGIC, step.id, step, scope))
    changes.append(document.remove(Kind.ACTION, call_id))
    if remove_function:
        changes += changes_to_remove(document, function.id)
    return changes, list(ids.values())


class _Copies:
    """Copies of the actions and logic of a function in the place of a call."""

    def __init__(
        self,
        document: Document,
        function: ProjectFunction,
        call: Action,
        ids: dict[str, str],
        *,
        remove_function: bool,
    ) -> None:
        self._function, self._call, self._ids = function, call, ids
        self._given = {parameter.name: parameter for parameter in call.parameters}
        removed = frozenset({call.id, *(ids if remove_function else ())})
        names = Names(document, document.function_of(call.id))
        returned = {
            _source(result): name
            for result, name in reversed(list(zip(function.returns, call.outputs(), strict=False)))
        }
        self.actions = [self._copy(action, names, removed, returned) for action in function.actions]

    def _copy(
        self, action: Action, names: Names, removed: frozenset[str], returned: dict[tuple[str, int], str]
    ) -> Action:
        flows = [
            replace(
                flow,
                outputs=[
                    names.output(returned.get((action.id, index), output), removed)
                    for index, output in enumerate(flow.outputs)
                ],
            )
            for flow in action.flows
        ]
        error = names.output(action.error_output, removed) if action.error_output else UNSET
        return replace(
            with_links(action, self._mapped),
            id=self._ids[action.id],
            name=names.action(action.name, removed),
            parameters=[self._parameter(one) for one in with_links(action, self._mapped).parameters],
            flows=flows,
            error_output=error,
            branches=mapped_branches(action, self._ids),
        )

    def _mapped(self, link: tuple[str, str, int]) -> str | None:
        return f"{self._ids[link[0]]}/{link[1]}/{link[2]}" if link[0] in self._ids else None

    def _parameter(self, parameter: ActionParameter) -> ActionParameter:
        if parameter.type != ActionParameterType.FUNCTION_PARAMETER:
            return parameter
        given = self._given.get(text_of(parameter))
        if given is None:
            raise RequestRefused(
                "{name} has no value for the parameter {parameter}.", name=self._call.name, parameter=text_of(parameter)
            )
        return ActionParameter(parameter.name, given.type, given.value)

    def logic(self, following: Sequence[LogicItem]) -> list[LogicItem]:
        """Return the logic of the copies. `following`: the logic items that leave the call."""
        steps: list[LogicItem] = []
        for item in self._function.logic:
            if action_of(item.start) == START:
                continue
            step = replace(with_condition(item, self._mapped), start=self._ids[action_of(item.start)])
            if action_of(item.end) != END:
                steps.append(replace(step, end=self._ids[action_of(item.end)], id=new_id("lit")))
                continue
            branches = any(each.has_condition for each in following)
            if branches and (step.is_error_exit or step.has_condition):
                raise RequestRefused(
                    "{name} is followed by a branch, and the function {function} ends in a branch. "
                    "Put an action between them first.",
                    name=self._call.name,
                    function=self._function.name,
                )
            for each in following:
                decides = each if branches else step
                steps.append(
                    replace(step, end=each.end, condition=decides.condition, when=decides.when, id=new_id("lit"))
                )
        return steps


def _source(result: FunctionReturns) -> tuple[str, int]:
    """Return the action of a result of a function, and the index of its own result."""
    action_id, _, index = parse_link(result.link)
    return action_id, index


def _point_of(document: Document, action: Action) -> str | None:
    """Return the action point that an action uses last, None if it uses none."""
    for parameter in reversed(action.parameters):
        key = reference(parameter.type, parameter.value)
        if parameter.type == "position":
            return key
        for kind in (Kind.ORIENTATION, Kind.JOINTS):
            if key is not None and (found := document.find(kind, key)) is not None:
                return found.parent
    return None


def changes_to_remove(document: Document, function_id: str) -> list[Change]:
    """Return the changes that remove a function with its actions and logic."""
    owned = [each for kind in (Kind.LOGIC, Kind.ACTION) for each in document.owned(function_id, kind)]
    return [document.remove(Kind.FUNCTION, function_id), *(document.remove(each.kind, each.id) for each in owned)]
