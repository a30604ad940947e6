"""The open scene and project as indexed items: the cost of an edit does not depend on their size."""

import operator
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Final, TypeVar

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.interlocks import Interlock
from arcor2_hw.data.project import (
    Action,
    ActionPoint,
    BareActionPoint,
    LogicItem,
    NamedOrientation,
    Project,
    ProjectFunction,
    ProjectParameter,
    ProjectRobotJoints,
)
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.documents.changes import OF_SCENE, Change, Item, Kind
from arcor2_server.documents.item_indexes import OWNED, ItemIndexes, action_of, place_of

ROOTS: Final = (Kind.OBJECT, Kind.INTERLOCK, Kind.PARAMETER, Kind.FUNCTION, Kind.SCENE, Kind.PROJECT)
"""Kinds of items that are roots of lock trees, in addition to action points without a parent."""

_TITLES: Final = {
    Kind.JOINTS: "joint configuration",
    Kind.PARAMETER: "project parameter",
    Kind.LOGIC: "logic item",
    Kind.OVERRIDE: "override of the object",
}
"""Names of kinds for users, where they differ."""

OUTPUT: Final = "output"
"""Scope of the names of results and errors in `Document.named`."""

UNTIMED: Final = {"created": UNSET, "modified": UNSET, "int_modified": UNSET}
"""Resets the times of a scene or project, since an undo must not change them."""

T = TypeVar("T", bound=msgspec.Struct)

_by_rank = operator.attrgetter("rank")


class Document:
    """Items by kind and id. Only `apply` changes them. Values are replaced, never modified.

    Implements `arcor2_hw.data.project_index.ProjectLookup`. Look-ups of an unknown id raise NotFound.
    """

    def __init__(self, items: Iterable[Item] = ()) -> None:
        self._items: dict[Kind, dict[str, Item]] = {kind: {} for kind in Kind}
        self._unordered: set[Kind] = set()
        self._next_rank = 0
        self._retired = False
        self._indexes = ItemIndexes()
        self._scene: Scene | None = None
        self._project: Project | None = None
        self._functions: dict[str, ProjectFunction] = {}
        """Cache of functions with their actions and logic, filled on request and cleared by changes."""
        for item in items:
            self._put(item)

    @classmethod
    def of(cls, scene: Scene, project: Project | None = None) -> "Document":
        """Create the document of a scene, or of a project on its scene."""
        document = cls()
        document.apply(document.changes_to_fill(scene, project))
        return document

    def changes_to_fill(self, scene: Scene, project: Project | None = None) -> list[Change]:
        """Return the changes that put a scene and project into an empty document."""
        add = self.add
        changes = [add(Kind.SCENE, scene.id, replace(scene, objects=[], interlocks=UNSET, **UNTIMED))]
        changes += [add(Kind.OBJECT, obj.id, obj) for obj in scene.objects]
        changes += [add(Kind.INTERLOCK, one.id, one) for one in scene.interlocks or ()]
        if project is None:
            return changes
        bare = replace(project, action_points=[], parameters=[], functions=[], logic=[], object_overrides=[], **UNTIMED)
        changes.append(add(Kind.PROJECT, project.id, bare))
        for point in project.action_points:
            changes.append(add(Kind.POINT, point.id, reduce_to(BareActionPoint, point)))
            changes += [add(Kind.ORIENTATION, o.id, o, point.id) for o in point.orientations]
            changes += [add(Kind.JOINTS, j.id, j, point.id) for j in point.robot_joints]
            changes += [add(Kind.ACTION, a.id, a, point.id) for a in point.actions]
        changes += [add(Kind.PARAMETER, p.id, p) for p in project.parameters]
        for function in project.functions:
            changes += self.changes_to_add(function)
        changes += [add(Kind.LOGIC, i.id, i) for i in project.logic]
        changes += [add(Kind.OVERRIDE, o.id, o) for o in project.object_overrides]
        return changes

    def changes_to_add(self, function: ProjectFunction) -> list[Change]:
        """Return the changes that add a function with its actions and logic."""
        return [
            self.add(Kind.FUNCTION, function.id, replace(function, actions=[], logic=[])),
            *(self.add(Kind.ACTION, action.id, action, function.id) for action in function.actions),
            *(self.add(Kind.LOGIC, item.id, item, function.id) for item in function.logic),
        ]

    # ------------------------------------------------------------------------------------------ changes
    def add(self, kind: Kind, item_id: str, value: Any, parent: str = "") -> Change:
        """Return the change that adds an item after the others of its kind."""
        self._check_open()
        self._next_rank += 1
        return Change(kind, item_id, parent, self._next_rank, None, value)

    def update(self, kind: Kind, item_id: str, value: Any) -> Change:
        """Return the change that replaces an item's value. Raise NotFound if there is none."""
        self._check_open()
        item = self._get(kind, item_id)
        return Change(kind, item_id, item.parent, item.rank, item.value, value)

    def remove(self, kind: Kind, item_id: str) -> Change:
        """Return the change that removes an item. Raise NotFound if there is none."""
        self._check_open()
        item = self._get(kind, item_id)
        return Change(kind, item_id, item.parent, item.rank, item.value, None)

    @contextmanager
    def retiring(self) -> Iterator[None]:
        """Refuse changes while this document is being closed, and afterwards unless closing fails."""
        self._retired = True
        try:
            yield
        except BaseException:
            self._retired = False
            raise

    def _check_open(self) -> None:
        if self._retired:
            raise InvalidData("The scene or project was closed in the meantime. Nothing was changed.")

    def apply(self, changes: Iterable[Change]) -> None:
        """Apply changes in order."""
        for change in changes:
            if change.before is not None:
                self._indexes.remove(self._items[change.kind][change.id])
                if change.after is None:
                    del self._items[change.kind][change.id]
            if change.after is not None:
                self._put(Item(change.kind, change.id, change.parent, change.rank, change.after))
            if change.kind in OF_SCENE:
                self._scene = None
            else:
                self._project = None
                self._functions.clear()

    def _put(self, item: Item) -> None:
        of_kind = self._items[item.kind]
        if item.rank < self._next_rank and item.id not in of_kind:
            self._unordered.add(item.kind)
        self._next_rank = max(self._next_rank, item.rank)
        of_kind[item.id] = item
        self._indexes.add(item)

    # ------------------------------------------------------------------------------------------ whole documents
    def of_kind(self, kind: Kind) -> list[Item]:
        """Return the items of a kind in their order."""
        if kind in self._unordered:
            ordered = sorted(self._items[kind].values(), key=_by_rank)
            self._items[kind] = {item.id: item for item in ordered}
            self._unordered.discard(kind)
        return list(self._items[kind].values())

    def items(self) -> list[Item]:
        """Return all items, kind by kind, in their order."""
        return [item for kind in Kind for item in self.of_kind(kind)]

    def count(self, kind: Kind) -> int:
        """Return the number of items of a kind."""
        return len(self._items[kind])

    @property
    def scene(self) -> Scene | None:
        """The scene, None if the document is empty."""
        if self._scene is None and (base := self._bare(Kind.SCENE)) is not None:
            interlocks = self.interlocks() or UNSET
            objects = [item.value for item in self.of_kind(Kind.OBJECT)]
            self._scene = replace(base, objects=objects, interlocks=interlocks)
        return self._scene

    @property
    def project(self) -> Project | None:
        """The project, None if the document has none."""
        if self._project is None and (base := self._bare(Kind.PROJECT)) is not None:
            self._project = replace(
                base,
                action_points=[self.full_point(item.id) for item in self.of_kind(Kind.POINT)],
                parameters=[item.value for item in self.of_kind(Kind.PARAMETER)],
                functions=[self.function(item.id) for item in self.of_kind(Kind.FUNCTION)],
                logic=[item.value for item in self.program_logic()],
                object_overrides=[item.value for item in self.of_kind(Kind.OVERRIDE)],
            )
        return self._project

    def _bare(self, kind: Kind) -> Any:
        return next((item.value for item in self._items[kind].values()), None)

    def full_point(self, point_id: str) -> ActionPoint:
        """Return an action point with orientations, joints and actions."""
        point = self.action_point(point_id)
        return ActionPoint(
            **msgspec.structs.asdict(point),
            orientations=[item.value for item in self.owned(point_id, Kind.ORIENTATION)],
            robot_joints=[item.value for item in self.owned(point_id, Kind.JOINTS)],
            actions=[item.value for item in self.owned(point_id, Kind.ACTION)],
        )

    # ------------------------------------------------------------------------------------------ one item
    def find(self, kind: Kind, item_id: str) -> Item | None:
        """Return an item, None if there is none."""
        return self._items[kind].get(item_id)

    def _get(self, kind: Kind, item_id: str) -> Item:
        try:
            return self._items[kind][item_id]
        except KeyError:
            what = _TITLES.get(kind, kind.replace("_", " "))
            raise NotFound("The {what} with the id {item_id!r} does not exist.", what=what, item_id=item_id) from None

    def scene_object(self, object_id: str) -> SceneObject:
        """Return an object of the scene."""
        value: SceneObject = self._get(Kind.OBJECT, object_id).value
        return value

    def interlocks(self) -> list[Interlock]:
        """Return the interlocks of the scene."""
        return [item.value for item in self.of_kind(Kind.INTERLOCK)]

    def interlock(self, interlock_id: str) -> Interlock:
        """Return an interlock."""
        value: Interlock = self._get(Kind.INTERLOCK, interlock_id).value
        return value

    def action_point(self, action_point_id: str) -> BareActionPoint:
        """Return an action point without its lists."""
        value: BareActionPoint = self._get(Kind.POINT, action_point_id).value
        return value

    def orientation(self, orientation_id: str) -> tuple[BareActionPoint, NamedOrientation]:
        """Return an orientation with its action point."""
        item = self._get(Kind.ORIENTATION, orientation_id)
        return self.action_point(item.parent), item.value

    def joints(self, joints_id: str) -> tuple[BareActionPoint, ProjectRobotJoints]:
        """Return joints with their action point."""
        item = self._get(Kind.JOINTS, joints_id)
        return self.action_point(item.parent), item.value

    def action(self, action_id: str) -> Action:
        """Return an action."""
        value: Action = self._get(Kind.ACTION, action_id).value
        return value

    def function(self, function_id: str) -> ProjectFunction:
        """Return a function with its actions and logic."""
        if (function := self._functions.get(function_id)) is None:
            bare: ProjectFunction = self._get(Kind.FUNCTION, function_id).value
            actions, logic = (
                [item.value for item in self.owned(function_id, kind)] for kind in (Kind.ACTION, Kind.LOGIC)
            )
            function = self._functions[function_id] = replace(bare, actions=actions, logic=logic)
        return function

    def find_function(self, function_id: str) -> ProjectFunction | None:
        """Return a function with its actions and logic, None if there is none."""
        return self.function(function_id) if function_id in self._items[Kind.FUNCTION] else None

    def function_of(self, action_id: str) -> str:
        """Return the id of the function that contains an action; empty for an action of the program."""
        item = self._items[Kind.ACTION].get(action_id)
        return item.parent if item is not None and item.parent in self._items[Kind.FUNCTION] else ""

    def parameter(self, parameter_id: str) -> ProjectParameter:
        """Return a project parameter."""
        value: ProjectParameter = self._get(Kind.PARAMETER, parameter_id).value
        return value

    def logic_item(self, logic_item_id: str) -> LogicItem:
        """Return a logic item."""
        value: LogicItem = self._get(Kind.LOGIC, logic_item_id).value
        return value

    def override(self, object_id: str) -> SceneObjectOverride:
        """Return the overrides of an object."""
        value: SceneObjectOverride = self._get(Kind.OVERRIDE, object_id).value
        return value

    # ------------------------------------------------------------------------------------------ relations
    def owned(self, point_id: str, kind: Kind) -> list[Item]:
        """Return the items of a kind that belong to an action point or function, in their order."""
        return sorted((self._items[kind][i] for i in self._indexes.owned_by(point_id, kind)), key=_by_rank)

    def points_of(self, parent_id: str) -> list[BareActionPoint]:
        """Return the action points whose parent is this object or action point."""
        ids = self._indexes.points.get(parent_id, ())
        return [item.value for item in sorted((self._items[Kind.POINT][i] for i in ids), key=_by_rank)]

    def descendants(self, parent_id: str) -> list[BareActionPoint]:
        """Return the action points below an object or action point, depth first, without itself."""
        found: list[BareActionPoint] = []
        waiting = self.points_of(parent_id)[::-1]
        while waiting:
            point = waiting.pop()
            found.append(point)
            waiting += self.points_of(point.id)[::-1]
        return found

    def named(self, kind: Kind | str, name: str, parent: str = "") -> str | None:
        """Return the id of the item with a name, None if the name is free.

        Names are unique per kind, those of orientations and joints within their action point. For the kind "output"
        the item is the action whose result has the name, and the parent is its function.
        """
        if kind == OUTPUT:
            found = self._indexes.names.get((kind, name), ())
            return next((action_id for action_id in found if self.function_of(action_id) == parent), None)
        scope = parent + kind if parent else kind
        return next(iter(self._indexes.names.get((scope, name), ())), None)

    def program_logic(self) -> list[Item]:
        """Return the logic items of the program, without those of functions, in their order."""
        return [item for item in self.of_kind(Kind.LOGIC) if not item.parent]

    def outgoing(self, start: str, function: str = "") -> list[LogicItem]:
        """Return the logic items that leave an action, or START of the program or of a function."""
        return [self._items[Kind.LOGIC][i].value for i in self._indexes.leaving.get(place_of(start, function), ())]

    def incoming(self, end: str) -> list[LogicItem]:
        """Return the logic items that arrive at END or an action."""
        return [self._items[Kind.LOGIC][i].value for i in self._indexes.arriving.get(end, ())]

    def leads_to(self, origin: str, target: str, without: str = "") -> bool:
        """Return whether the logic, without the item `without`, leads from one action to another.

        Alternates between a forward and a backward search and ends with the shorter one. So it is fast when a step is
        added at the start or end of a long program.
        """
        items = self._items[Kind.LOGIC]
        seen, other_seen = {origin}, {target}
        waiting, other_waiting = [origin], [target]
        forward = True
        while waiting and other_waiting:
            place = waiting.pop()
            for key in (self._indexes.leaving if forward else self._indexes.arriving).get(place, ()):
                if key == without:
                    continue
                value = items[key].value
                following = action_of(value.end if forward else value.start)
                if following in other_seen:
                    return True
                if following not in seen:
                    seen.add(following)
                    waiting.append(following)
            seen, other_seen = other_seen, seen
            waiting, other_waiting = other_waiting, waiting
            forward = not forward
        return False

    def variable(self, name: str, function: str = "") -> ProjectParameter | None:
        """Return the variable with a name, in which actions of the program store results, None if there is none.

        Actions of a function do not store results in variables.
        """
        key = None if function else self.named(Kind.PARAMETER, name)
        parameter = None if key is None else self.parameter(key)
        return parameter if parameter is not None and parameter.variable else None

    def naming(self, output: str) -> Action | None:
        """Return an action of the program or function whose result or error has this name, None if there is none."""
        return next((self.action(key) for key in self._indexes.names.get((OUTPUT, output), ())), None)

    def storing(self, parameter: ProjectParameter) -> list[Action]:
        """Return the actions that store a result in a variable."""
        if not parameter.variable:
            return []
        found = [key for key in self._indexes.names.get((OUTPUT, parameter.name), ()) if not self.function_of(key)]
        return [action for key in found if parameter.name in (action := self.action(key)).outputs()]

    def users_of(self, target_id: str) -> list[Action | LogicItem | ProjectFunction]:
        """Return the actions with a parameter that refers to this id, and the logic items with a condition on it.

        The users of an action include the function that returns a result of it, and the parallel action of which it
        is a branch. The users of a function are its calls.
        """
        actions, logic, functions = (self._items[kind] for kind in (Kind.ACTION, Kind.LOGIC, Kind.FUNCTION))
        return [(actions.get(i) or logic.get(i) or functions[i]).value for i in self._indexes.users.get(target_id, ())]

    def calls_of(self, function_id: str) -> list[Action]:
        """Return the actions that call a function."""
        return [user for user in self.users_of(function_id) if isinstance(user, Action)]

    def parallel_of(self, action_id: str) -> Action | None:
        """Return the parallel action of which an action is a branch, None for an action that is not a branch."""
        users = (user for user in self.users_of(action_id) if isinstance(user, Action))
        return next((user for user in users if action_id in (user.branches or ())), None)

    def root_of(self, item: str) -> str:
        """Return the root of the lock tree that an id belongs to (protocol, section 6). Raise NotFound if unknown."""
        for kind in OWNED:
            if (owned := self._items[kind].get(item)) is not None:
                item = owned.parent
                break
        points = self._items[Kind.POINT]
        seen = set()
        while (point := points.get(item)) is not None and point.value.parent and item not in seen:
            seen.add(item)
            item = point.value.parent
        if item in points or any(item in self._items[kind] for kind in ROOTS):
            return item
        raise NotFound("The open scene or project has no item {item!r}.", item=item)

    def tree_of(self, root: str) -> list[str]:
        """Return the ids below a root: its action points with their items; empty if it is not a root."""
        points = [point.id for point in self.descendants(root)]
        below = [
            i for holder in (root, *points) for kind in OWNED for i in self._indexes.owned.get(holder, {}).get(kind, ())
        ]
        return points + below


def reduce_to(base: type[T], value: Any) -> T:
    """Return an instance of a base class of a struct, with the fields of this base class."""
    return base(**{name: getattr(value, name) for name in base.__struct_fields__})
