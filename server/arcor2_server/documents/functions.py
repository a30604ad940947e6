"""Makes functions from actions of a program."""

from collections.abc import Sequence

from msgspec.structs import replace

from arcor2_hw.data.base import new_id
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
    FunctionReturns,
    LogicItem,
    ProjectFunction,
    parse_link,
)
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.checks.actions import action_meta, text_of
from arcor2_server.documents.checks.object_types import Types
from arcor2_server.documents.document import Document
from arcor2_server.documents.function_links import (
    Names,
    changes_of_users,
    encoded,
    free_name,
    tested_by,
    used_by,
    with_condition,
)
from arcor2_server.documents.item_indexes import action_of
from arcor2_server.documents.parallel_work import mapped_branches, with_branches
from arcor2_server.errors import RequestRefused

EXTERNAL_VALUES = frozenset({ActionParameterType.PROJECT_PARAMETER, ActionParameterType.FUNCTION_PARAMETER})
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


class _Selection:
    """The selected actions with the logic around them. Raises NoFunction if they cannot be a function."""

    def __init__(self, document: Document, action_ids: Sequence[str]) -> None:
        self.document = document
        self.ids = with_branches(document, action_ids)
        self.actions = {key: document.action(key) for key in self.ids}
        self.scope = document.function_of(self.ids[0])
        if any(document.function_of(key) != self.scope for key in self.ids):
            raise NotConnected("The actions are not all part of the program or of one function.")
        logic = document.owned(self.scope, Kind.LOGIC) if self.scope else document.program_logic()
        self.inside: list[LogicItem] = []
        self.arriving: list[LogicItem] = []
        self.leaving: list[LogicItem] = []
        self.own: list[LogicItem] = []
        """The logic items that start at the selected actions, in the order in which their conditions are tested."""
        for item in (each.value for each in logic):
            starts, ends = action_of(item.start) in self.actions, action_of(item.end) in self.actions
            if starts:
                self.own.append(item)
            if starts or ends:
                (self.inside if starts and ends else self.leaving if starts else self.arriving).append(item)
        for action in self.actions.values():
            for output in action.outputs():
                if document.variable(output, self.scope) is not None:
                    raise NoFunction(
                        "{name}: only the program changes the variable {output}. Do not select this action.",
                        name=action.name,
                        output=output,
                    )
        self.entry = self._entry()
        self.exit = self._exit()
        self._check_conditions()

    def _named(self, keys: Sequence[str]) -> str:
        return ", ".join(key if key == END else self.document.action(key).name for key in keys)

    def _entry(self) -> str:
        entries = list(dict.fromkeys(action_of(item.end) for item in self.arriving))
        if not entries:
            followed = {action_of(item.end) for item in self.inside}
            followed.update(key for action in self.actions.values() for key in action.branches or ())
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
        for key, action in self.actions.items():
            following.setdefault(key, []).extend(action.branches or ())
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
        for item in self.own:
            outside = [tested for tested in tested_by(item) if tested[0] not in self.actions]
            for tested in outside[:1]:
                raise NoFunction(
                    "A condition of {name} uses a result of {tested}, which is not selected. Select {tested}, too.",
                    name=self._named([action_of(item.start)]),
                    tested=self._named([tested[0]]),
                )


class _Parameters:
    """The parameters of a new function: the values that its actions use from outside."""

    def __init__(self, document: Document, types: Types, selection: _Selection) -> None:
        self.declared: list[ActionParameter] = []
        self.given: list[ActionParameter] = []
        """The parameters of the call."""
        self._document, self._types, self._selection = document, types, selection
        self._names: dict[tuple[str, str], str] = {}
        """The names of parameters, by type and target of the value that they pass on."""
        self._taken = {name for action in selection.actions.values() for name in action.names()}

    def replaced(self, action: Action, ids: dict[str, str]) -> Action:
        """Return an action for the function, with a new id, and its links and parameters adapted to the function."""
        meta = action_meta(action, self._document, self._types)
        kinds = {each.name: each.type for each in meta.parameters}

        def parameter(parameter: ActionParameter) -> ActionParameter:
            if parameter.type == ActionParameterType.LINK:
                source, flow, index = parse_link(text_of(parameter))
                if source in ids:
                    return replace(parameter, value=encoded(f"{ids[source]}/{flow}/{index}"))
            elif parameter.type not in EXTERNAL_VALUES:
                return parameter
            name = self._name(parameter, kinds[meta.present_name(parameter.name)])
            return replace(parameter, type=ActionParameterType.FUNCTION_PARAMETER, value=encoded(name))

        return replace(
            action,
            id=ids[action.id],
            parameters=[parameter(one) for one in action.parameters],
            branches=mapped_branches(action, ids),
        )

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
    own = {*selection.ids, *(item.id for item in selection.own)}

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
    own = selection.own
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
