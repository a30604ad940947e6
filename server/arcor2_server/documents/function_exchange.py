"""Exports a function with the items to which its actions refer, and imports it into another project."""

from collections.abc import Iterator, Mapping
from typing import Final

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import new_id
from arcor2_hw.data.project import (
    CALL,
    END,
    START,
    Action,
    ActionParameter,
    ActionParameterType,
    LogicItem,
    ProjectFunction,
    parse_link,
)
from arcor2_hw.data.rpc import FunctionExport, NamedReference
from arcor2_hw.exceptions import InvalidData
from arcor2_server.documents.changes import Change, Item, Kind
from arcor2_server.documents.checks.actions import text_of
from arcor2_server.documents.document import Document
from arcor2_server.documents.function_links import Names, encoded, with_condition, with_links
from arcor2_server.documents.item_indexes import action_of
from arcor2_server.documents.parallel_work import mapped_branches
from arcor2_server.errors import RequestRefused

OBJECT: Final = "object"
"""Kind of a reference to an object of the scene. Kinds of other references are types of parameters."""
_POINT_ITEMS: Final = {"pose": Kind.ORIENTATION, "joints": Kind.JOINTS}


class MissingItem(RequestRefused):
    """The project has no item for a reference of an imported function."""

    code = "missing_items"


# ---------------------------------------------------------------------------------------------- export
def export_function(document: Document, function_id: str) -> FunctionExport:
    """Return a function with the functions that it calls, and the items to which their actions refer.

    Raises:
        NotFound: the function, or an item to which an action refers, does not exist.
    """
    functions = list(_with_callees(document, function_id))
    references: dict[tuple[str, str], NamedReference] = {}
    for action in (action for function in functions for action in function.actions):
        for kind, key in _references(document, action):
            if (kind, key) not in references:
                references[kind, key] = _named(document, kind, key)
    scene = document.of_kind(Kind.SCENE)[0]
    return FunctionExport(scene.id, functions, list(references.values()))


def _with_callees(document: Document, function_id: str) -> Iterator[ProjectFunction]:
    """Yield the functions that a function calls, each before its callers, and the function itself."""
    done: set[str] = set()
    waiting = [document.function(function_id)]
    while waiting:
        function = waiting[-1]
        called = [action.type.partition("/")[0] for action in function.actions]
        callees = [found for key in called if key not in done and (found := document.find_function(key)) is not None]
        if callees:
            waiting.append(callees[0])
            continue
        waiting.pop()
        if function.id not in done:
            done.add(function.id)
            yield function


def _references(document: Document, action: Action) -> Iterator[tuple[str, str]]:
    key = action.type.partition("/")[0]
    if document.find(Kind.FUNCTION, key) is None:
        yield OBJECT, key
    for parameter in action.parameters:
        if parameter.type in ("position", *_POINT_ITEMS, ActionParameterType.PROJECT_PARAMETER):
            yield str(parameter.type), text_of(parameter)


def _named(document: Document, kind: str, key: str) -> NamedReference:
    match kind:
        case "object":
            obj = document.scene_object(key)
            return NamedReference(kind, key, obj.name, type=obj.type)
        case "position":
            point = document.action_point(key)
            return NamedReference(kind, key, point.name, point.id, point.name)
        case "pose":
            point, orientation = document.orientation(key)
            return NamedReference(kind, key, orientation.name, point.id, point.name)
        case "joints":
            point, joints = document.joints(key)
            return NamedReference(kind, key, joints.name, point.id, point.name, robot_id=joints.robot_id)
        case _:
            parameter = document.parameter(key)
            return NamedReference(kind, key, parameter.name, type=parameter.type)


# ---------------------------------------------------------------------------------------------- import
def import_function(
    document: Document, export: FunctionExport, points: Mapping[str, str]
) -> tuple[list[Change], list[str]]:
    """Return the changes that add exported functions to a document, and the ids of the new functions.

    Args:
        document: the document.
        export: the exported functions.
        points: ids or names of action points of the document, by ids or names of exported action points. Without them,
            functions that the exported one calls are not added if the document contains them unchanged.

    Raises:
        Missing: the document lacks items; the message lists all of them.
        InvalidData: the export is damaged.
    """
    found = _ReferencedItems(document, points)
    ids: dict[tuple[str, str], str] = {}
    for reference in export.references:
        if (key := found.find(reference)) is not None:
            ids[reference.kind, reference.id] = key
    if found.missing:
        raise MissingItem("The project lacks: {missing}.", missing="; ".join(found.missing))
    try:
        return _FunctionImport(document, export, ids, keep=not points).changes()
    except KeyError as error:
        key = error.args[0][-1] if isinstance(error.args[0], tuple) else error.args[0]
        raise InvalidData("The exported function is damaged: {id} is missing.", id=key) from error
    except ValueError as error:
        raise InvalidData("The exported function is damaged: {reason}.", reason=error) from error


class _ReferencedItems:
    """Finds the items of a document for references. `missing` describes those that do not exist."""

    def __init__(self, document: Document, points: Mapping[str, str]) -> None:
        self._document, self._points = document, points
        self.missing: list[str] = []

    def find(self, reference: NamedReference) -> str | None:
        """Return the id of the item for a reference, None if it is missing."""
        document = self._document
        match reference.kind:
            case "object":
                item = self._by_id_or_name(Kind.OBJECT, reference)
                if item is not None and item.value.type == reference.type:
                    return item.id
                self.missing.append(f"the object {reference.name} of type {reference.type}")
            case "project_parameter":
                item = self._by_id_or_name(Kind.PARAMETER, reference)
                if item is not None and item.value.type == reference.type:
                    return item.id
                self.missing.append(f"the project parameter {reference.name} of type {reference.type}")
            case "position":
                if (point := self._point(reference)) is not None:
                    return point.id
                self.missing.append(f"the action point {reference.name}")
            case "pose" | "joints":
                kind = _POINT_ITEMS[reference.kind]
                item = document.find(kind, reference.id)
                if (point := self._point(reference)) is None:
                    self.missing.append(f"the action point {reference.point}")
                    return None
                if item is None or item.parent != point.id:
                    item = document.find(kind, document.named(kind, reference.name, point.id) or "")
                if item is not None and (kind is Kind.ORIENTATION or item.value.robot_id == reference.robot_id):
                    return item.id
                what = "orientation" if kind is Kind.ORIENTATION else "joints"
                self.missing.append(f"the {what} {reference.name} of the action point {point.value.name}")
            case _:
                raise InvalidData("The exported function is damaged: unknown reference {kind}.", kind=reference.kind)
        return None

    def _by_id_or_name(self, kind: Kind, reference: NamedReference) -> Item | None:
        document = self._document
        return document.find(kind, reference.id) or document.find(kind, document.named(kind, reference.name) or "")

    def _point(self, reference: NamedReference) -> Item | None:
        document = self._document
        for key in (reference.point_id, reference.point):
            if isinstance(key, str) and key in self._points:
                wanted = self._points[key]
                return document.find(Kind.POINT, wanted) or document.find(
                    Kind.POINT, document.named(Kind.POINT, wanted) or ""
                )
        found = document.find(Kind.POINT, str(reference.point_id))
        return found or document.find(Kind.POINT, document.named(Kind.POINT, str(reference.point)) or "")


class _FunctionImport:
    """One import.

    Args:
        document: the document.
        export: the exported functions.
        ids: the items of the document by kind and id of a reference.
        keep: whether to call functions of the document that equal exported ones, instead of adding copies.
    """

    def __init__(
        self, document: Document, export: FunctionExport, ids: Mapping[tuple[str, str], str], *, keep: bool
    ) -> None:
        self._document, self._export, self._ids = document, export, ids
        self._names = Names(document)
        called = export.functions[:-1] if keep else []
        kept = {function.id for function in called if document.find_function(function.id) == function}
        self._new = [function for function in export.functions if function.id not in kept]
        self._functions = {each.id: each.id if each.id in kept else new_id("pfu") for each in export.functions}
        actions = [action.id for function in export.functions for action in function.actions]
        self._actions = {key: new_id("act") for key in actions}
        if len(self._functions) < len(export.functions) or len(self._actions) < len(actions):
            raise ValueError("an id is used twice")

    def changes(self) -> tuple[list[Change], list[str]]:
        """Return the changes, and the ids of the functions. Raise KeyError or ValueError if the export is damaged."""
        changes: list[Change] = []
        for function in self._new:
            changes += self._document.changes_to_add(self._function(function))
        return changes, [self._functions[function.id] for function in self._new]

    def _mapped(self, link: tuple[str, str, int]) -> str:
        return f"{self._actions[link[0]]}/{link[1]}/{link[2]}"

    def _function(self, function: ProjectFunction) -> ProjectFunction:
        return replace(
            function,
            id=self._functions[function.id],
            name=self._names.function(function.name),
            actions=[self._action(action) for action in function.actions],
            logic=[self._step(item) for item in function.logic],
            returns=[replace(each, link=self._mapped(parse_link(each.link))) for each in function.returns],
        )

    def _action(self, action: Action) -> Action:
        key, method = action.parse_type()
        target = self._functions.get(key) if method == CALL else key if action.is_parallel else None
        return replace(
            with_links(action, self._mapped),
            id=self._actions[action.id],
            name=self._names.action(action.name),
            type=f"{target or self._ids[OBJECT, key]}/{method}",
            parameters=[self._parameter(one) for one in with_links(action, self._mapped).parameters],
            error_output=action.error_output or UNSET,
            branches=mapped_branches(action, self._actions),
        )

    def _parameter(self, parameter: ActionParameter) -> ActionParameter:
        if parameter.type not in ("position", *_POINT_ITEMS, ActionParameterType.PROJECT_PARAMETER):
            return parameter
        return replace(parameter, value=encoded(self._ids[parameter.type, text_of(parameter)]))

    def _step(self, item: LogicItem) -> LogicItem:
        start, end = (
            place if place in (START, END) else self._actions[place]
            for place in (action_of(item.start), action_of(item.end))
        )
        return replace(with_condition(item, self._mapped), start=start, end=end, id=new_id("lit"))
