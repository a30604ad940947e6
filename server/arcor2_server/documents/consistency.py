"""Checks whether a document stays consistent after an undo. Only items that the changes affect are checked."""

from collections.abc import Callable, Iterable, Sequence

from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.project import END, START, Action, LogicItem, ProjectFunction
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_hw.messages import Message
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.checks.actions import action_meta, check_action
from arcor2_server.documents.checks.functions import check_function
from arcor2_server.documents.checks.interlocks import check_interlock, using
from arcor2_server.documents.checks.object_types import Types
from arcor2_server.documents.checks.scene import object_problems
from arcor2_server.documents.document import OUTPUT, Document
from arcor2_server.documents.item_indexes import OWNED, action_of, link_of, reference
from arcor2_server.documents.logic import check_logic_item, check_no_loops, scope_of
from arcor2_server.documents.reparenting import check_no_loop, check_parent

_NAMED_IN_POINT = (Kind.ORIENTATION, Kind.JOINTS)
_NAMED = (Kind.OBJECT, Kind.INTERLOCK, Kind.POINT, Kind.ACTION, Kind.PARAMETER, Kind.FUNCTION, *_NAMED_IN_POINT)


class Inconsistent(InvalidData):
    """The document would become inconsistent; `ids` are the conflicting items."""

    code = "unsound"

    def __init__(self, message: str | Message, ids: Iterable[str], **values: object) -> None:
        super().__init__(message, "", **values)
        self.ids = set(ids)


def check_consistent(document: Document, changes: Sequence[Change], types: Types) -> None:
    """Check that the document is consistent with the changes applied, and leave it unchanged.

    Raises:
        Inconsistent: It would be inconsistent.
    """
    document.apply(changes)
    try:
        for change in changes:
            if change.after is None:
                _check_unused(document, change)
            else:
                _check_name(document, change)
                if (check := _CHECKS.get(change.kind)) is not None:
                    check(document, change, types)
        _check_loops(document, [c.after for c in changes if c.kind is Kind.LOGIC and c.after is not None])
    finally:
        document.apply([change.inverse() for change in reversed(changes)])


def title(change: Change) -> str:
    """Return the name and kind of the changed item for users: `home (action point)`."""
    value = change.before if change.after is None else change.after
    name = getattr(value, "name", "")
    what = {Kind.LOGIC: "step of the logic", Kind.OVERRIDE: "override"}.get(change.kind, change.kind.replace("_", " "))
    return f"{name} ({what})" if name else f"a {what}"


def _check_unused(document: Document, change: Change) -> None:
    key = change.id
    users: list[str] = [user.id for user in document.users_of(key)]
    if change.kind is Kind.OBJECT:
        users += [one.id for one in using(key, document.interlocks())]
    if change.kind is Kind.POINT:
        users += [point.id for point in document.points_of(key)]
        users += [item.id for kind in OWNED for item in document.owned(key, kind)]
    if change.kind is Kind.FUNCTION:
        users += [item.id for kind in (Kind.ACTION, Kind.LOGIC) for item in document.owned(key, kind)]
    if change.kind is Kind.ACTION:
        users += [item.id for item in (*document.outgoing(key), *document.incoming(key))]
    if users:
        raise Inconsistent("{change} is used by later edits.", users, change=title(change))


def _check_name(document: Document, change: Change) -> None:
    if change.kind not in _NAMED:
        return
    names: list[tuple[str, str, str]] = [
        (change.kind, change.after.name, change.parent if change.kind in _NAMED_IN_POINT else "")
    ]
    if change.kind is Kind.ACTION:
        function = document.function_of(change.id)
        outputs = change.after.outputs()
        names += [
            (OUTPUT, output, function)
            for output in change.after.names()
            if output not in outputs or document.variable(output, function) is None
        ]
    for kind, name, parent in names:
        other = document.named(kind, name, parent)
        if other is not None and other != change.id:
            raise Inconsistent("The name {name} is taken.", [other], name=name)


def _object(document: Document, change: Change, types: Types) -> None:  # noqa: ARG001
    if problems := object_problems(change.after, types):
        raise Inconsistent(Message.joined(problems), [])


def _interlock(document: Document, change: Change, types: Types) -> None:
    try:
        check_interlock(change.after, document.scene_object, types)
    except Arcor2Error as error:
        needed = {need.object_id for need in change.after.needs}
        raise Inconsistent(error.message, {change.after.object_id, *needed}) from None


def _point(document: Document, change: Change, types: Types) -> None:  # noqa: ARG001
    point = change.after
    if isinstance(point.parent, Unset):
        return
    try:
        check_parent(document, point.parent, point.name)
        check_no_loop(document, point, point.parent)
    except Arcor2Error as error:
        above = {point.parent, *(each.id for each in document.descendants(point.id))}
        raise Inconsistent(error.message, above) from None


def _owned(document: Document, change: Change, types: Types) -> None:  # noqa: ARG001
    kinds = (Kind.POINT, Kind.FUNCTION) if change.kind is Kind.ACTION else (Kind.POINT,)
    if all(document.find(kind, change.parent) is None for kind in kinds):
        raise Inconsistent(
            "The action point or function of {change} no longer exists.", [change.parent], change=title(change)
        )


def _action(document: Document, change: Change, types: Types) -> None:
    _owned(document, change, types)
    _check_action(document, change.after, types)
    _check_branches(document, change.after)
    _check_users(document, change.id, types)


def _check_branches(document: Document, action: Action) -> None:
    for key in action.branches or ():
        items = [item.id for item in (*document.outgoing(key), *document.incoming(key))]
        others = [
            user.id
            for user in document.users_of(key)
            if isinstance(user, Action) and user.id != action.id and key in (user.branches or ())
        ]
        if items or others:
            raise Inconsistent(
                "{call} is connected, or part of other parallel work.",
                [*items, *others],
                call=document.action(key).name,
            )


def _check_users(document: Document, key: str, types: Types) -> None:
    for user in document.users_of(key):
        match user:
            case Action():
                _check_action(document, user, types, blamed=user.id)
            case LogicItem():
                _check_step(document, user, types)
            case ProjectFunction():
                _check_function(document, user.id, types)


def _check_action(document: Document, action: Action, types: Types, blamed: str = "") -> None:
    function_id = document.function_of(action.id)
    try:
        check_action(action, document, types, document.find_function(function_id))
    except Arcor2Error as error:
        targets = {reference(parameter.type, parameter.value) for parameter in action.parameters}
        targets |= {action.type.partition("/")[0], function_id}
        raise Inconsistent(error.message, [blamed] if blamed else [target for target in targets if target]) from None


def _function(document: Document, change: Change, types: Types) -> None:
    _check_function(document, change.id, types)
    for item in document.owned(change.id, Kind.ACTION):
        _check_action(document, item.value, types, blamed=item.id)
    _check_users(document, change.id, types)


def _check_function(document: Document, key: str, types: Types) -> None:
    function = document.function(key)
    try:
        check_function(function, document, types)
    except Arcor2Error as error:
        sources = {link[0] for link in map(link_of, function.returns) if link is not None}
        raise Inconsistent(error.message, {key, *sources}) from None


def _logic(document: Document, change: Change, types: Types) -> None:
    project = next((item for item in document.of_kind(Kind.PROJECT)), None)
    if change.parent and document.find(Kind.FUNCTION, change.parent) is None:
        raise Inconsistent("The function of {change} no longer exists.", [change.parent], change=title(change))
    if project is not None and not project.value.has_logic and not change.parent:
        raise Inconsistent("The project {name} no longer has logic.", [project.id], name=project.value.name)
    _check_step(document, change.after, types)


def _check_step(document: Document, item: LogicItem, types: Types) -> None:
    meta_of: Callable[[Action], ObjectAction] = lambda action: action_meta(action, document, types)  # noqa: E731
    try:
        check_logic_item(document, meta_of, item, loops=False)
    except Arcor2Error as error:
        places = {action_of(item.start), action_of(item.end)} - {START, END}
        siblings = {other.id for other in document.outgoing(action_of(item.start), scope_of(document, item))} - {
            item.id
        }
        raise Inconsistent(error.message, places | siblings | item.used()) from None


def _check_loops(document: Document, steps: list[LogicItem]) -> None:
    try:
        check_no_loops(document, steps)
    except InvalidData as error:
        # Any of the other steps may close the loop; the caller reports the latest edit.
        own = {step.id for step in steps}
        raise Inconsistent(error.message, {item.id for item in document.of_kind(Kind.LOGIC)} - own) from None


def _project(document: Document, change: Change, types: Types) -> None:  # noqa: ARG001
    if not change.after.has_logic and (steps := document.program_logic()):
        raise Inconsistent("{name} has steps of its logic.", [item.id for item in steps], name=change.after.name)


_CHECKS: dict[Kind, Callable[[Document, Change, Types], None]] = {
    Kind.OBJECT: _object,
    Kind.INTERLOCK: _interlock,
    Kind.PROJECT: _project,
    Kind.POINT: _point,
    Kind.ORIENTATION: _owned,
    Kind.JOINTS: _owned,
    Kind.ACTION: _action,
    Kind.FUNCTION: _function,
    Kind.LOGIC: _logic,
}
