"""Makes functions from actions of a program, and dissolves calls into the actions of their function."""

import contextlib
import itertools
from collections.abc import Callable, Sequence

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import Unset, new_id
from arcor2_hw.data.project import (
    CALL,
    END,
    ERROR_FLOW,
    ERROR_PARTS,
    START,
    Action,
    ActionParameter,
    ActionParameterType,
    Flow,
    FlowTypes,
    FunctionReturns,
    LogicItem,
    ProjectFunction,
    ProjectLogicIf,
    parse_link,
)
from arcor2_hw.exceptions import InvalidData
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.checks.actions import action_meta, text_of
from arcor2_server.documents.checks.object_types import Types
from arcor2_server.documents.document import OUTPUT, Document
from arcor2_server.documents.item_indexes import action_of, link_of, links, reference
from arcor2_server.errors import RequestRefused

FROM_OUTSIDE = frozenset({ActionParameterType.PROJECT_PARAMETER, ActionParameterType.FUNCTION_PARAMETER})
"""Parameters of actions that become parameters of the function, in addition to links to actions outside of it."""


class NoFunction(RequestRefused):
    """The selected actions cannot be a function."""

    code = "no_function"


class SeveralEntries(NoFunction):
    """Connections from outside lead to several of the selected actions."""

    code = "several_entries"


class SeveralExits(NoFunction):
    """Connections lead from the selected actions to several others."""

    code = "several_exits"


class NotConnected(NoFunction):
    """The selected actions are not connected."""

    code = "not_connected"


def encoded(value: object) -> str:
    """Return a value as JSON."""
    return msgspec.json.encode(value).decode()


def free_name(name: str, is_taken: Callable[[str], bool]) -> str:
    """Return a name, with `_2`, `_3` ... if it is taken."""
    if not is_taken(name):
        return name
    return next(free for number in itertools.count(2) if not is_taken(free := f"{name}_{number}"))


class Names:
    """Free names of new items, which are different from each other, too."""

    def __init__(self, document: Document, function: str = "") -> None:
        self._document = document
        self._function = function
        self._given: set[tuple[str, str]] = set()

    def _free(self, kind: Kind | str, name: str, without: frozenset[str]) -> str:
        parent = self._function if kind == OUTPUT else ""

        def is_taken(wanted: str) -> bool:
            other = self._document.named(kind, wanted, parent)
            return (kind, wanted) in self._given or (other is not None and other not in without)

        found = free_name(name, is_taken)
        self._given.add((kind, found))
        return found

    def action(self, name: str, without: frozenset[str] = frozenset()) -> str:
        """Return a free name of an action. `without`: actions that are removed."""
        return self._free(Kind.ACTION, name, without)

    def function(self, name: str) -> str:
        """Return a free name of a function."""
        return self._free(Kind.FUNCTION, name, frozenset())

    def output(self, name: str, without: frozenset[str] = frozenset()) -> str:
        """Return a free name of a result or error in the program, or in the function. `without`: as in `action`."""
        return self._free(OUTPUT, name, without)


def with_links(action: Action, changed: Callable[[tuple[str, str, int]], str | None]) -> Action:
    """Return an action with other links, as far as `changed` returns one for the parts of its link."""

    def parameter(one: ActionParameter) -> ActionParameter:
        if one.type != ActionParameterType.LINK:
            return one
        try:
            link = changed(parse_link(text_of(one)))
        except (InvalidData, ValueError):
            return one  # the checks report a malformed link
        return one if link is None else replace(one, value=encoded(link))

    return replace(action, parameters=[parameter(one) for one in action.parameters])


def with_condition(item: LogicItem, changed: Callable[[tuple[str, str, int]], str | None]) -> LogicItem:
    """Return a logic item with a condition on another result, if `changed` returns one."""
    tested = tested_by(item)
    what = None if tested is None else changed(tested)
    if what is None or isinstance(item.condition, Unset):
        return item
    return replace(item, condition=ProjectLogicIf(what, item.condition.value))


def tested_by(item: LogicItem) -> tuple[str, str, int] | None:
    """Return the result that the condition of a logic item tests, None without a condition or if it is malformed."""
    if not isinstance(item.condition, Unset):
        with contextlib.suppress(ValueError):
            return item.condition.parse_what()
    return None


def used_by(user: Action | LogicItem | ProjectFunction) -> list[tuple[str, str, int]]:
    """Return the results and errors that an action, a condition or a function uses."""
    match user:
        case Action():
            return list(links(user))
        case LogicItem():
            return [] if (tested := tested_by(user)) is None else [tested]
        case ProjectFunction():
            return [link for each in user.returns if (link := link_of(each)) is not None]


def changes_of_users(
    document: Document,
    action_ids: Sequence[str],
    changed: Callable[[tuple[str, str, int]], str | None],
    without: frozenset[str] = frozenset(),
) -> list[Change]:
    """Return the changes of links, conditions and results of functions that use actions, with other links.

    without: users that are not changed.
    """
    users = {user.id: user for key in action_ids for user in document.users_of(key) if user.id not in without}
    changes: list[Change] = []
    for user in users.values():
        match user:
            case Action():
                changes.append(document.update(Kind.ACTION, user.id, with_links(user, changed)))
            case LogicItem():
                changes.append(document.update(Kind.LOGIC, user.id, with_condition(user, changed)))
            case ProjectFunction():
                returns = [
                    each
                    if (before := link_of(each)) is None or (link := changed(before)) is None
                    else replace(each, link=link)
                    for each in user.returns
                ]
                changes.append(document.update(Kind.FUNCTION, user.id, replace(user, returns=returns)))
    return changes


# ---------------------------------------------------------------------------------------------- make
class _Selection:
    """The selected actions with the logic around them. Raises NoFunction if they cannot be a function."""

    def __init__(self, document: Document, action_ids: Sequence[str]) -> None:
        self.document = document
        self.ids = list(dict.fromkeys(action_ids))
        self.actions = {key: document.action(key) for key in self.ids}
        self.scope = document.function_of(self.ids[0])
        if any(document.function_of(key) != self.scope for key in self.ids):
            raise NotConnected("The actions are not all part of the program or of one function.")
        logic = document.owned(self.scope, Kind.LOGIC) if self.scope else document.program_logic()
        self.inside: list[LogicItem] = []
        self.arriving: list[LogicItem] = []
        self.leaving: list[LogicItem] = []
        for item in (each.value for each in logic):
            starts, ends = action_of(item.start) in self.actions, action_of(item.end) in self.actions
            if starts or ends:
                (self.inside if starts and ends else self.leaving if starts else self.arriving).append(item)
        self.entry = self._entry()
        self.exit = self._exit()
        self._check_conditions()

    def _named(self, keys: Sequence[str]) -> str:
        return ", ".join(key if key == END else self.document.action(key).name for key in keys)

    def _entry(self) -> str:
        entries = list(dict.fromkeys(action_of(item.end) for item in self.arriving))
        if not entries:
            followed = {action_of(item.end) for item in self.inside}
            entries = [key for key in self.ids if key not in followed]
        if len(entries) > 1:
            names = self._named(entries)
            if not self.arriving:
                raise NotConnected("These actions are not connected: {names}. Select connected actions.", names=names)
            raise SeveralEntries(
                "A function starts with one action, but connections from outside lead to {names}.", names=names
            )
        reached, waiting = {entries[0]}, [entries[0]]
        following: dict[str, list[str]] = {}
        for item in self.inside:
            following.setdefault(action_of(item.start), []).append(action_of(item.end))
        while waiting:
            for key in following.get(waiting.pop(), ()):
                if key not in reached:
                    reached.add(key)
                    waiting.append(key)
        if missing := [key for key in self.ids if key not in reached]:
            raise NotConnected(
                "{name} does not lead to {names}. Select connected actions.",
                name=self._named(entries),
                names=self._named(missing),
            )
        return entries[0]

    def _exit(self) -> str | None:
        exits = list(dict.fromkeys(action_of(item.end) for item in self.leaving))
        if len(exits) > 1:
            raise SeveralExits(
                "A function leads to one next action, but connections lead to {names}.", names=self._named(exits)
            )
        return exits[0] if exits else None

    def _check_conditions(self) -> None:
        for item in (*self.inside, *self.leaving):
            tested = tested_by(item)
            if tested is not None and tested[0] not in self.actions:
                raise NoFunction(
                    "A condition of {name} uses a result of {tested}, which is not selected. Select {tested}, too.",
                    name=self._named([action_of(item.start)]),
                    tested=self._named([tested[0]]),
                )


class _Parameters:
    """The parameters of a new function: what its actions use from outside."""

    def __init__(self, document: Document, types: Types, selection: _Selection) -> None:
        self.declared: list[ActionParameter] = []
        self.given: list[ActionParameter] = []
        """The parameters of the call."""
        self._document, self._types, self._selection = document, types, selection
        self._names: dict[tuple[str, str], str] = {}
        """The names of parameters, by type and target of what they pass on."""
        self._taken = {name for action in selection.actions.values() for name in action.names()}

    def replaced(self, action: Action, ids: dict[str, str]) -> Action:
        """Return an action of the function with a new id, its own links, and parameters of the function."""
        meta = action_meta(action, self._document, self._types)
        kinds = {each.name: each.type for each in meta.parameters}

        def parameter(one: ActionParameter) -> ActionParameter:
            if one.type == ActionParameterType.LINK:
                source, flow, index = parse_link(text_of(one))
                if source in ids:
                    return replace(one, value=encoded(f"{ids[source]}/{flow}/{index}"))
            elif one.type not in FROM_OUTSIDE:
                return one
            name = self._name(one, kinds[meta.present_name(one.name)])
            return replace(one, type=ActionParameterType.FUNCTION_PARAMETER, value=encoded(name))

        return replace(action, id=ids[action.id], parameters=[parameter(one) for one in action.parameters])

    def _name(self, given: ActionParameter, kind: str) -> str:
        """Return the name of the parameter that passes on `given`."""
        key = (given.type, text_of(given))
        if (name := self._names.get(key)) is None:
            name = self._names[key] = free_name(self._wanted(given), self._taken.__contains__)
            self._taken.add(name)
            self.declared.append(ActionParameter(name, kind, ""))
            self.given.append(ActionParameter(name, given.type, given.value))
        return name

    def _wanted(self, given: ActionParameter) -> str:
        target = text_of(given)
        if given.type == ActionParameterType.PROJECT_PARAMETER:
            return self._document.parameter(target).name
        if given.type == ActionParameterType.FUNCTION_PARAMETER:
            return target
        source_id, flow, index = parse_link(target)
        source = self._document.action(source_id)
        if flow == ERROR_FLOW:
            return f"{source.error_output or source.name}_{ERROR_PARTS[index]}"
        return source.outputs()[index]


def _results_used_outside(document: Document, selection: _Selection) -> list[tuple[str, int]]:
    """Return the results of the selected actions that links, conditions or a function outside of them use."""
    found: dict[tuple[str, int], None] = {}
    own = {*selection.ids, *(item.id for item in (*selection.inside, *selection.leaving))}

    def note(link: tuple[str, str, int]) -> None:
        if link[1] == ERROR_FLOW:
            raise NoFunction(
                "The error of {name} is used by an action that is not selected. Select it, too.",
                name=document.action(link[0]).name,
            )
        action = selection.actions[link[0]]
        if link[2] >= len(action.outputs()):
            raise NoFunction(
                "{source} has no named result number {index}. Name its results.", source=action.name, index=link[2]
            )
        found[link[0], link[2]] = None

    for key in selection.ids:
        for user in document.users_of(key):
            if user.id in own:
                continue
            for link in used_by(user):
                if link[0] == key:
                    note(link)
    return list(found)


def make_function(
    document: Document, types: Types, name: str, action_ids: Sequence[str], call_name: str = ""
) -> tuple[list[Change], str, str]:
    """Return the changes that move actions into a new function and call it, and the ids of the function and the call.

    Args:
        document: the open document.
        types: the object types.
        name: the name of the function.
        action_ids: the actions, in the order in which the function lists them.
        call_name: the name of the call; by default that of the function.

    Raises:
        NoFunction: the actions cannot be a function.
        InvalidData: an action is invalid.
        NotFound: an action does not exist.
    """
    selection = _Selection(document, action_ids)
    function_id, call_id = new_id("pfu"), new_id("act")
    ids = {key: new_id("act") for key in selection.ids}
    parameters = _Parameters(document, types, selection)
    actions = [parameters.replaced(action, ids) for action in selection.actions.values()]
    used = _results_used_outside(document, selection)
    outputs, returns = [], []
    for source, index in used:
        action = selection.actions[source]
        meta = action_meta(action, document, types)
        outputs.append(action.outputs()[index])
        returns.append(FunctionReturns(meta.returns[index], f"{ids[source]}/default/{index}"))
    removed = frozenset(selection.ids)
    call = Action(
        Names(document).action(call_name or name, removed),
        f"{function_id}/{CALL}",
        call_id,
        parameters.given,
        [Flow(outputs=outputs)],
    )

    def inner(link: tuple[str, str, int]) -> str | None:
        return f"{ids[link[0]]}/{link[1]}/{link[2]}" if link[0] in ids else None

    def of_call(link: tuple[str, str, int]) -> str | None:
        return f"{call_id}/default/{used.index((link[0], link[2]))}" if link[0] in ids else None

    logic = [LogicItem(START, ids[selection.entry], id=new_id("lit"))]
    own = (*selection.inside, *selection.leaving)
    for item in own:
        start, end = ids[action_of(item.start)], ids.get(action_of(item.end), END)
        logic.append(replace(with_condition(item, inner), start=start, end=end, id=new_id("lit")))
    function = ProjectFunction(name, actions, logic, parameters.declared, returns, function_id)
    entry = document.find(Kind.ACTION, selection.entry)
    assert entry is not None
    changes = [
        *document.changes_to_add(function),
        document.add(Kind.ACTION, call.id, call, entry.parent),
        *changes_of_users(document, selection.ids, of_call, removed.union(item.id for item in own)),
        *(document.update(Kind.LOGIC, item.id, replace(item, end=call_id)) for item in selection.arriving),
        *(document.remove(Kind.LOGIC, item.id) for item in own),
        *(document.remove(Kind.ACTION, key) for key in selection.ids),
    ]
    if selection.exit is not None:
        step = LogicItem(call_id, selection.exit, id=new_id("lit"))
        changes.append(document.add(Kind.LOGIC, step.id, step, selection.scope))
    return changes, function_id, call_id


# ---------------------------------------------------------------------------------------------- dissolve
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
        )

    def _mapped(self, link: tuple[str, str, int]) -> str | None:
        return f"{self._ids[link[0]]}/{link[1]}/{link[2]}" if link[0] in self._ids else None

    def _parameter(self, one: ActionParameter) -> ActionParameter:
        if one.type != ActionParameterType.FUNCTION_PARAMETER:
            return one
        given = self._given.get(text_of(one))
        if given is None:
            raise RequestRefused(
                "{name} has no value for the parameter {parameter}.", name=self._call.name, parameter=text_of(one)
            )
        return ActionParameter(one.name, given.type, given.value)

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
            branches = any(not isinstance(each.condition, Unset) for each in following)
            if branches and (step.is_error_exit or not isinstance(step.condition, Unset)):
                raise RequestRefused(
                    "{name} is followed by a branch, and the function {function} ends in a branch. "
                    "Put an action between them first.",
                    name=self._call.name,
                    function=self._function.name,
                )
            for each in following:
                condition = each.condition if branches else step.condition
                steps.append(replace(step, end=each.end, condition=condition, id=new_id("lit")))
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
