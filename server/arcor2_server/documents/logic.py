"""Rules for logic items, the connections between actions (protocol, section 10.4)."""

from collections.abc import Callable, Iterable

import msgspec

from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.project import END, START, Action, LogicItem, ProjectLogicIf, parse_link
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message, translatable
from arcor2_server.documents.comparisons import check_when, condition_key, is_result
from arcor2_server.documents.document import Document
from arcor2_server.documents.item_indexes import action_of
from arcor2_server.documents.logic_graph import BRANCHABLE, error_kinds_problem


def check_logic_item(
    document: Document, meta_of: Callable[[Action], ObjectAction], item: LogicItem, *, loops: bool = True
) -> None:
    """Check an item that is to be added, or to replace the one with its id.

    Args:
        document: The open document.
        meta_of: Returns the metadata of an action.
        item: The item.
        loops: Also check that the item closes no loop. `check_no_loops` does so for many items at once.

    Raises:
        InvalidData: The item violates a rule.
        NotFound: An action does not exist.
    """
    start, end = _place(item.start, START), _place(item.end, END)
    if start == START and end == END:
        raise InvalidData("START cannot lead straight to END: put an action between them.")
    if start == end:
        raise InvalidData("{name} cannot lead to itself.", name=_name(document, start))
    for place in {start, end} - {START, END}:
        document.action(place)
        if (parallel := document.parallel_of(place)) is not None:
            raise InvalidData(
                "{parallel} runs {name} in parallel: connect {parallel}.",
                name=_name(document, place),
                parallel=parallel.name,
            )
    if item.has_comparisons and not isinstance(item.condition, Unset):
        raise InvalidData("A step has either a condition or comparisons, not both.")
    function = scope_of(document, item)
    if end != END and document.function_of(end) != function:
        raise InvalidData(
            "{name} and {other_name} are not actions of the same function.",
            name=_name(document, start),
            other_name=_name(document, end),
        )
    siblings = [other for other in document.outgoing(start, function) if other.id != item.id]
    if start == START and siblings:
        raise InvalidData("START leads to {name} already.", name=_name(document, action_of(siblings[0].end)))
    if any(action_of(other.end) == end and other.is_error_exit == item.is_error_exit for other in siblings):
        raise InvalidData(
            "{name} leads to {other_name} already.", name=_name(document, start), other_name=_name(document, end)
        )
    if item.is_error_exit:
        _check_error_exit(document, start, item, siblings)
    else:
        _check_otherwise(document, start, [item, *(other for other in siblings if not other.is_error_exit)])
    if item.has_condition:
        if start == START:
            raise InvalidData("The step from START cannot have a condition, because no action has a result yet.")
        if not isinstance(item.condition, Unset):
            _check_condition(document, meta_of, item.condition, function)
        if not isinstance(item.when, Unset):
            check_when(item.when, lambda one: _compared(document, meta_of, one, function))
        key = condition_key(item)
        if any(condition_key(other) == key for other in siblings):
            raise InvalidData("Another step from {name} has the same condition.", name=_name(document, start))
    if loops and start != START and end != END and document.leads_to(end, start, item.id):
        raise InvalidData(
            "The step from {name} to {other_name} would close a loop.",
            name=_name(document, start),
            other_name=_name(document, end),
        )


def scope_of(document: Document, item: LogicItem) -> str:
    """Return the id of the function to which a logic item belongs by its actions; empty for the program."""
    start = action_of(item.start)
    return document.function_of(action_of(item.end) if start == START else start)


def _check_error_exit(document: Document, start: str, item: LogicItem, siblings: list[LogicItem]) -> None:
    if start == START:
        raise InvalidData("The step from START cannot be an error exit, because START is not an action.")
    if item.has_condition:
        raise InvalidData("An error exit of {name} cannot have a condition.", name=_name(document, start))
    kinds = item.error_kinds or []
    if (problem := error_kinds_problem(kinds)) is not None:
        raise InvalidData(problem)
    for other in siblings:
        if shared := set(kinds).intersection(other.error_kinds or ()):
            raise InvalidData(
                "{name} has another error exit for {kind}.", name=_name(document, start), kind=min(shared)
            )


def _check_otherwise(document: Document, start: str, items: list[LogicItem]) -> None:
    """Refuse an unconditional connection next to others, except next to conditions that are not boolean."""
    without = sum(not item.has_condition for item in items)
    if len(items) == 1 or not without:
        return
    conditions = [item.condition for item in items if not isinstance(item.condition, Unset)]
    if any(isinstance(msgspec.json.decode(condition.value), bool) for condition in conditions if _is_json(condition)):
        raise InvalidData("Each of several steps from {name} needs a condition.", name=_name(document, start))
    if without > 1:
        raise InvalidData("Each of several steps from {name} but one needs a condition.", name=_name(document, start))


def _is_json(condition: ProjectLogicIf) -> bool:
    try:
        msgspec.json.decode(condition.value)
    except msgspec.DecodeError:
        return False
    return True


def check_no_loops(document: Document, items: Iterable[LogicItem]) -> None:
    """Raise InvalidData if one of these items of the document is part of a loop."""
    done: set[str] = set()
    for item in items:
        path = [action_of(item.start)]
        on_path = set(path)
        # The items still to be followed from each action on the path.
        waiting = [document.outgoing(path[0])] if path[0] not in done else []
        while waiting:
            if not waiting[-1]:
                waiting.pop()
                left = path.pop()
                on_path.discard(left)
                done.add(left)
                continue
            following = action_of(waiting[-1].pop().end)
            if following in on_path:
                raise InvalidData("The steps through {name} would close a loop.", name=_name(document, following))
            if following not in done:
                path.append(following)
                on_path.add(following)
                waiting.append(document.outgoing(following))


def _place(text: str, border: str) -> str:
    """Return the action id, or START or END, of one side of an item."""
    action_id, slash, flow = text.partition("/")
    if not action_id or (slash and (flow != "default" or action_id == border)):
        raise InvalidData("{text!r} names no action: write its id, or {border}.", text=text, border=border)
    if action_id == (END if border == START else START):
        raise InvalidData("A step cannot start at END." if border == START else "A step cannot end at START.")
    return action_id


def _name(document: Document, place: str) -> str:
    return place if place in (START, END) else document.action(place).name


def _check_condition(
    document: Document, meta_of: Callable[[Action], ObjectAction], condition: ProjectLogicIf, function: str
) -> None:
    try:
        action_id, flow, index = condition.parse_what()
    except ValueError as error:
        raise InvalidData("The condition is malformed: {reason}.", reason=error) from None
    output, returned = _result(document, meta_of, (action_id, flow, index), function)
    kind = BRANCHABLE.get(returned)
    if kind is None:
        raise InvalidData(
            "The result {output} of {name} is {return_value}. Conditions test booleans, integers and enumerations.",
            output=output,
            name=document.action(action_id).name,
            return_value=returned,
        )
    try:
        value = msgspec.json.decode(condition.value)
    except msgspec.DecodeError:
        value = None
    if type(value) is not kind:
        expected = {bool: "true or false", int: "an integer", str: "a text in quotes"}
        wanted = Message.of(translatable(expected)[kind])
        raise InvalidData(
            "A condition on {output} compares with {wanted}, not with {value}.",
            output=output,
            wanted=wanted,
            value=condition.value[:40],
        )


def _result(
    document: Document, meta_of: Callable[[Action], ObjectAction], link: tuple[str, str, int], function: str
) -> tuple[str, str]:
    """Return the name and the type of a result that an item of the logic of `function` uses."""
    action_id, flow, index = link
    action = document.action(action_id)
    if document.function_of(action_id) != function:
        raise InvalidData(
            "The condition uses a result of {name}, an action of another function or of the program.", name=action.name
        )
    outputs, returns = action.outputs(), meta_of(action).returns
    if flow != "default" or index >= len(outputs) or index >= len(returns):
        raise InvalidData(
            "Action {name} has no named result number {index}: name its results first.", name=action.name, index=index
        )
    if document.variable(outputs[index], function) is not None:
        raise InvalidData(
            "{name} stores its result in the variable {output}: use the variable.",
            name=action.name,
            output=outputs[index],
        )
    return outputs[index], returns[index]


def _compared(
    document: Document, meta_of: Callable[[Action], ObjectAction], reference: str, function: str
) -> tuple[str, str]:
    """Return the name and the type of a compared value."""
    if not is_result(reference):
        parameter = document.parameter(reference)
        return parameter.name, parameter.type
    try:
        link = parse_link(reference)
    except ValueError as error:
        raise InvalidData("The condition is malformed: {reason}.", reason=error) from None
    return _result(document, meta_of, link, function)
