"""Links, conditions and results between actions: how they change when actions move into a function or out of it."""

import contextlib
import itertools
from collections.abc import Callable, Sequence

import msgspec
from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.project import (
    Action,
    ActionParameter,
    ActionParameterType,
    LogicItem,
    ProjectFunction,
    ProjectLogicIf,
    parse_link,
)
from arcor2_hw.exceptions import InvalidData
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.checks.actions import text_of
from arcor2_server.documents.document import OUTPUT, Document
from arcor2_server.documents.item_indexes import link_of, links


def encoded(value: object) -> str:
    """Return a value as JSON."""
    return msgspec.json.encode(value).decode()


def free_name(name: str, is_taken: Callable[[str], bool]) -> str:
    """Return a name, with the suffix `_2`, `_3` ... if it is taken."""
    if not is_taken(name):
        return name
    return next(free for number in itertools.count(2) if not is_taken(free := f"{name}_{number}"))


class Names:
    """Free names of new items, which also differ from each other."""

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
    """Return an action whose links are replaced where `changed` returns a replacement."""

    def parameter(parameter: ActionParameter) -> ActionParameter:
        if parameter.type != ActionParameterType.LINK:
            return parameter
        try:
            link = changed(parse_link(text_of(parameter)))
        except (InvalidData, ValueError):
            return parameter  # the checks report a malformed link
        return parameter if link is None else replace(parameter, value=encoded(link))

    return replace(action, parameters=[parameter(one) for one in action.parameters])


def with_condition(item: LogicItem, changed: Callable[[tuple[str, str, int]], str | None]) -> LogicItem:
    """Return a logic item whose condition refers to other results where `changed` returns a replacement."""

    def link(value: str) -> str:
        try:
            return changed(parse_link(value)) or value
        except ValueError:
            return value  # a project parameter, or a malformed link, which the checks report

    if not isinstance(item.condition, Unset):
        item = replace(item, condition=ProjectLogicIf(link(item.condition.what), item.condition.value))
    if not isinstance(item.when, Unset):
        comparisons = [
            replace(one, what=link(one.what), other=one.other if isinstance(one.other, Unset) else link(one.other))
            for one in item.when.comparisons
        ]
        item = replace(item, when=replace(item.when, comparisons=comparisons))
    return item


def tested_by(item: LogicItem) -> list[tuple[str, str, int]]:
    """Return the results that the condition of a logic item tests, without malformed links."""
    links = [] if isinstance(item.condition, Unset) else [item.condition.what]
    if not isinstance(item.when, Unset):
        links += [what for one in item.when.comparisons for what in one.compared()]
    found: list[tuple[str, str, int]] = []
    for link in links:
        with contextlib.suppress(ValueError):
            found.append(parse_link(link))
    return found


def used_by(user: Action | LogicItem | ProjectFunction) -> list[tuple[str, str, int]]:
    """Return the results and errors that an action, a condition or a function uses."""
    match user:
        case Action():
            return list(links(user))
        case LogicItem():
            return tested_by(user)
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
