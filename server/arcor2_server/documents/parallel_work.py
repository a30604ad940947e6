"""Parallel actions, which run several function calls concurrently: changes that create and dissolve them."""

import itertools
from collections.abc import Iterable, Mapping, Sequence

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset, new_id
from arcor2_hw.data.project import CALL, PARALLEL, Action, Flow, LogicItem
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.document import Document
from arcor2_server.documents.function_links import Names
from arcor2_server.documents.item_indexes import action_of
from arcor2_server.documents.logic_graph import branches_problem
from arcor2_server.errors import RequestRefused


def mapped_branches(action: Action, ids: Mapping[str, str]) -> list[str] | Unset:
    """Return the branches of a copy of an action, whose branches are copied, too. `ids`: the copies by id.

    Raises:
        RequestRefused: a branch is not copied.
    """
    if isinstance(action.branches, Unset):
        return UNSET
    if any(key not in ids for key in action.branches):
        raise RequestRefused("{name} runs calls that are not selected. Select them, too.", name=action.name)
    return [ids[key] for key in action.branches]


def with_branches(document: Document, action_ids: Iterable[str]) -> list[str]:
    """Return selected actions with the branches of parallel ones. Raise RequestRefused for a branch by itself."""
    found = {key: None for given in action_ids for key in (given, *(document.action(given).branches or ()))}
    for key in found:
        owner = document.parallel_of(key)
        if owner is not None and owner.id not in found:
            raise RequestRefused(
                "{owner} runs {name} in parallel. Select {owner}, too.",
                name=document.action(key).name,
                owner=owner.name,
            )
    return list(found)


def make_parallel(document: Document, name: str, action_ids: Sequence[str]) -> tuple[list[Change], str]:
    """Return the changes that make calls run concurrently, and the id of the parallel action.

    Args:
        document: the open document.
        name: the name of the parallel action.
        action_ids: the calls. They follow each other, or are not connected.

    Raises:
        RequestRefused: the actions cannot run concurrently.
        NotFound: an action does not exist.
    """
    calls = [document.action(key) for key in dict.fromkeys(action_ids)]
    if (problem := branches_problem([call.id for call in calls])) is not None:
        raise RequestRefused("{reason}.", reason=problem)
    for call in calls:
        if call.type.partition("/")[2] != CALL:
            raise RequestRefused("{name} does not call a function. Make a function of it first.", name=call.name)
        if any(item.is_error_exit for item in document.outgoing(call.id)):
            raise RequestRefused("{name} has error exits. Remove them first.", name=call.name)
    order, between = _in_order(document, calls)
    first, last = order[0], order[-1]
    place = document.find(Kind.ACTION, first.id)
    assert place is not None
    parallel = Action(
        Names(document).action(name), PARALLEL, new_id("act"), [], [Flow()], branches=[call.id for call in order]
    )
    changes = [document.add(Kind.ACTION, parallel.id, parallel, place.parent)]
    arriving, leaving = document.incoming(first.id), document.outgoing(last.id)
    changes += [document.update(Kind.LOGIC, item.id, replace(item, end=parallel.id)) for item in arriving]
    changes += [document.update(Kind.LOGIC, item.id, replace(item, start=parallel.id)) for item in leaving]
    changes += [document.remove(Kind.LOGIC, item.id) for item in between]
    return changes, parallel.id


def _in_order(document: Document, calls: Sequence[Action]) -> tuple[list[Action], list[LogicItem]]:
    """Return calls in the order in which they follow each other, and the logic items between them."""
    ids = {call.id: call for call in calls}
    between = [item for call in calls for item in document.outgoing(call.id) if action_of(item.end) in ids]
    if not any(document.outgoing(call.id) or document.incoming(call.id) for call in calls):
        return list(calls), []
    following = {action_of(item.start): action_of(item.end) for item in between}
    entries = [call for call in calls if call.id not in following.values()]
    order = [entries[0].id] if len(entries) == 1 else []
    while order and order[-1] in following:
        order.append(following[order[-1]])
    inner = {item.id for item in between}
    chained = len(order) == len(calls) and all(
        [item.id for item in document.outgoing(start)] == [item.id for item in document.incoming(end)]
        and {item.id for item in document.outgoing(start)} <= inner
        for start, end in itertools.pairwise(order)
    )
    if not chained or any(item.has_condition for item in between):
        raise RequestRefused("The calls must follow each other, without other connections and conditions.")
    return [ids[key] for key in order], between


def dissolve_parallel(document: Document, action_id: str) -> list[Change]:
    """Return the changes that let the calls of a parallel action run one after the other in its place.

    Raises:
        RequestRefused: the action is not parallel work, or it has error exits.
        NotFound: the action does not exist.
    """
    parallel = document.action(action_id)
    branches = parallel.branches or []
    if not parallel.is_parallel or not branches:
        raise RequestRefused("{name} is not parallel work.", name=parallel.name)
    leaving, arriving = document.outgoing(action_id), document.incoming(action_id)
    if any(item.is_error_exit for item in leaving):
        raise RequestRefused("{name} has error exits. Remove them first.", name=parallel.name)
    scope = document.function_of(action_id)
    changes = [document.update(Kind.LOGIC, item.id, replace(item, end=branches[0])) for item in arriving]
    changes += [document.update(Kind.LOGIC, item.id, replace(item, start=branches[-1])) for item in leaving]
    for start, end in itertools.pairwise(branches) if arriving or leaving else ():
        step = LogicItem(start, end, id=new_id("lit"))
        changes.append(document.add(Kind.LOGIC, step.id, step, scope))
    return [*changes, document.remove(Kind.ACTION, action_id)]
