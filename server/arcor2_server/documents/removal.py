"""Rules for removing action points and actions, and the logic without a removed action."""

from collections.abc import Collection

from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.project import (
    ERROR_FLOW,
    Action,
    BareActionPoint,
    FlowTypes,
    LogicItem,
    ProjectFunction,
    parse_link,
)
from arcor2_hw.exceptions import InvalidData
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.checks.actions import action_meta
from arcor2_server.documents.checks.object_types import Types
from arcor2_server.documents.document import Document
from arcor2_server.documents.item_indexes import OWNED, action_of, links
from arcor2_server.documents.logic import check_logic_item
from arcor2_server.errors import RequestRefused


def require_point_unused(document: Document, point: BareActionPoint) -> None:
    """Raise RequestRefused if something outside an action point depends on it or on its children."""
    if below := document.points_of(point.id):
        raise RequestRefused(
            "{point_name} is the parent of {name}. Remove {name} or change its parent first.",
            name=below[0].name,
            point_name=point.name,
        )
    own = {item.id for item in document.owned(point.id, Kind.ACTION)}
    for action_id in own:
        if document.outgoing(action_id) or document.incoming(action_id):
            raise RequestRefused(
                "The action {name} on {point_name} is used in the logic.",
                name=document.action(action_id).name,
                point_name=point.name,
            )
    for needed in (point.id, *(item.id for kind in OWNED for item in document.owned(point.id, kind))):
        for user in document.users_of(needed):
            if isinstance(user, LogicItem):
                raise RequestRefused("A condition of the logic uses a result of an action on {name}.", name=point.name)
            if user.id not in own and isinstance(user, Action) and needed in (user.branches or ()):
                raise RequestRefused(
                    "{user} runs {name} in parallel. Remove {user} first.",
                    user=user.name,
                    name=document.action(needed).name,
                )
            if user.id not in own:
                raise RequestRefused(
                    "The action {name} uses {point_name}, or one of its orientations, joints or actions.",
                    name=user.name,
                    point_name=point.name,
                )


def require_unused(document: Document, action: Action, without: Collection[str] = ()) -> None:
    """Raise RequestRefused if something other than the items `without` uses an action."""
    for user in document.users_of(action.id):
        if user.id in without:
            continue
        if isinstance(user, Action) and action.id in (user.branches or ()):
            raise RequestRefused(
                "{user} runs {name} in parallel. Remove {user} first.", user=user.name, name=action.name
            )
        using = title_of(user)
        raise RequestRefused(
            "A result of {name} is used by {user}. Change {user} first.",
            name=action.name,
            user=using[0].lower() + using[1:],
        )


def title_of(user: Action | LogicItem | ProjectFunction) -> str:
    """Return a name for the user of a result, for the start of a sentence."""
    match user:
        case Action():
            return f"The action {user.name}"
        case ProjectFunction():
            return f"The function {user.name}"
        case _:
            return "A condition of the logic"


def require_results_unused(document: Document, before: Action, after: Action) -> None:
    """Raise RequestRefused if `after` lacks the results of `before`, and a link or a condition uses one of them."""
    for user in document.users_of(before.id):
        if isinstance(user, Action):
            flows = {link[1] for link in links(user) if link[0] == before.id}
        else:
            flows = {str(FlowTypes.DEFAULT)}
        if ERROR_FLOW in flows and before.error_output and not after.error_output:
            raise RequestRefused(
                "The action {user} uses the error of {name}, so its error must keep a name.",
                user=user.name if isinstance(user, Action) else "",
                name=before.name,
            )
        function = document.function_of(before.id)
        stored = {n for n, output in enumerate(after.outputs()) if document.variable(output, function) is not None}
        lost = not after.outputs() or not stored.isdisjoint(_used_results(user, before.id))
        if FlowTypes.DEFAULT not in flows or not before.outputs() or not lost:
            continue
        raise RequestRefused(
            "{user} uses a result of {name}, so its results must keep their names.",
            user=title_of(user),
            name=before.name,
        )


def _used_results(user: Action | LogicItem | ProjectFunction, action_id: str) -> set[int]:
    """Return the indexes of the results of an action that an action or a condition uses."""
    if isinstance(user, Action):
        return {index for source, flow, index in links(user) if source == action_id and flow == FlowTypes.DEFAULT}
    if isinstance(user, ProjectFunction):
        return {index for source, _, index in (parse_link(one.link) for one in user.returns) if source == action_id}
    compared = [] if isinstance(user.condition, Unset) else [user.condition.what]
    if not isinstance(user.when, Unset):
        compared += [what for one in user.when.comparisons for what in one.compared()]
    found = [parse_link(what) for what in compared if "/" in what]
    return {index for source, _, index in found if source == action_id}


def neighbours(document: Document, action_id: str) -> set[str]:
    """Return the actions before and after an action in the logic; START and END count as actions."""
    before = {action_of(item.start) for item in document.incoming(action_id)}
    return before | {action_of(item.end) for item in document.outgoing(action_id)}


def bypass(document: Document, types: Types, action: Action) -> list[Change]:
    """Return the changes that remove an action from the logic.

    If exactly one unconditional logic item leaves the action, apart from error exits, the incoming logic items are
    redirected to its end where the result is valid. All other logic items of the action are removed.
    """
    changes = [document.remove(Kind.LOGIC, item.id) for item in document.outgoing(action.id)]
    outgoing = [item for item in document.outgoing(action.id) if not item.is_error_exit]
    end = outgoing[0].end if len(outgoing) == 1 and not outgoing[0].has_condition else None
    for item in document.incoming(action.id):
        redirected = None if end is None else replace(item, end=end)
        if redirected is not None and _is_valid(document, types, redirected):
            changes.append(document.update(Kind.LOGIC, item.id, redirected))
        else:
            changes.append(document.remove(Kind.LOGIC, item.id))
    return changes


def _is_valid(document: Document, types: Types, item: LogicItem) -> bool:
    try:
        check_logic_item(document, lambda action: action_meta(action, document, types), item)
    except InvalidData:
        return False
    return True
