"""Updates saved projects and generated object types after a scene was saved or deleted."""

from collections.abc import Awaitable, Callable, Iterable, Sequence

from msgspec.structs import replace

from arcor2_hw.data.object_type import ObjectTypeMeta
from arcor2_hw.data.project import Action, LogicItem, Project, ProjectFunction
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import NotFound
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.document import Document
from arcor2_server.documents.reparenting import changes_for_parent
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.storage import Storage

VIRTUAL = "VirtualCollisionObject"


def invalid_joints_below(document: Document, parent_id: str) -> list[Change]:
    """Return the changes that mark the joints at all action points below an object or action point as invalid."""
    return [
        document.update(Kind.JOINTS, item.id, replace(item.value, is_valid=False))
        for point in document.descendants(parent_id)
        for item in document.owned(point.id, Kind.JOINTS)
        if item.value.is_valid
    ]


def project_after(scene: Scene, project: Project, removed: Iterable[str], moved: Iterable[str]) -> Project:
    """Update a project after objects of its scene were removed or moved.

    Action points of removed objects keep their pose in the world.

    Args:
        scene: The scene before the change.
        project: The project.
        removed: The ids of removed objects.
        moved: The ids of moved objects.

    Returns:
        The updated project, or `project` itself if nothing changes.
    """
    document = Document.of(scene, project)
    changes: list[Change] = []

    def apply(new: list[Change]) -> None:
        document.apply(new)
        changes.extend(new)

    for object_id in moved:
        apply(invalid_joints_below(document, object_id))
    for object_id in removed:
        for point in document.points_of(object_id):
            apply(changes_for_parent(document, point.id, "")[0])
        for item in document.of_kind(Kind.ACTION):
            if item.value.type.partition("/")[0] == object_id:
                apply(_without_action(document, item.value))
        if document.find(Kind.OVERRIDE, object_id) is not None:
            apply([document.remove(Kind.OVERRIDE, object_id)])
    result = document.project
    return project if not changes or result is None else replace(result, created=project.created)


def _without_action(document: Document, action: Action) -> list[Change]:
    steps = {item.id: item for item in (*document.outgoing(action.id), *document.incoming(action.id))}
    users = document.users_of(action.id)
    steps |= {user.id: user for user in users if isinstance(user, LogicItem)}
    returning = [
        replace(user, returns=[each for each in user.returns if each.link.partition("/")[0] != action.id])
        for user in users
        if isinstance(user, ProjectFunction)
    ]
    return [
        *(document.remove(Kind.LOGIC, i) for i in steps),
        *(document.update(Kind.FUNCTION, function.id, function) for function in returning),
        document.remove(Kind.ACTION, action.id),
    ]


def _uses(project: Project, object_id: str) -> bool:
    return any(point.parent == object_id for point in project.action_points) or any(
        action.type.partition("/")[0] == object_id for action in project.all_actions()
    )


class Dependents:
    """Saved projects and object types that depend on the open scene."""

    def __init__(self, storage: Storage, types: ObjectTypes, session: Session) -> None:
        self._storage = storage
        self._types = types
        self._session = session

    async def after_saving(self, save: Callable[[], Awaitable[None]]) -> list[ObjectTypeMeta]:
        """Save the open scene. Mark joints at moved objects as invalid in all its projects except the open one.

        Items of removed objects are removed from these projects. Return the deleted object types.
        """
        scene = self._session.require_scene()
        try:
            before = await self._storage.scene(scene.id)
        except NotFound:
            before = replace(scene, objects=[])
        used_types = self._session.removed_types | {obj.type for obj in before.objects}
        await save()
        await self._update_projects(before, scene)
        self._session.removed_types.clear()
        return await self.delete_unused_types(used_types - {obj.type for obj in scene.objects})

    async def _update_projects(self, before: Scene, after: Scene) -> None:
        present = {obj.id: obj for obj in after.objects}
        removed = [obj.id for obj in before.objects if obj.id not in present]
        moved = [obj.id for obj in before.objects if obj.id in present and present[obj.id].pose != obj.pose]
        if not removed and not moved:
            return
        opened = self._session.project  # its joints became invalid when the object was moved
        for project_id in await self._storage.projects_with_scene(after.id):
            if opened is not None and project_id == opened.id:
                continue
            project = await self._storage.project(project_id)
            changed = project_after(before, project, removed, moved)
            if changed is not project:
                await self._storage.put_project(changed)

    async def delete_unused_types(self, candidates: Iterable[str]) -> list[ObjectTypeMeta]:
        """Delete the candidates that are virtual collision objects and used in no scene; return them."""
        types = self._types
        virtual = {
            name for name in candidates if name != VIRTUAL and types.known(name) and types.derives_from(name, VIRTUAL)
        }
        if not virtual:
            return []
        if (opened := self._session.scene) is not None:
            virtual -= {obj.type for obj in opened.objects}
        for listed in await self._storage.scenes():
            if not virtual:
                break
            virtual -= {obj.type for obj in (await self._storage.scene(listed.id)).objects}
        return [await types.remove(name) for name in sorted(virtual)]

    async def uses_object(self, object_id: str, after: Sequence[Change] = ()) -> set[str]:
        """Return the saved projects of the open scene, and the open project after some changes, that use an object."""
        session = self._session
        scene, opened = session.require_scene(), session.project
        found = set()
        for project_id in await self._storage.projects_with_scene(scene.id):
            if (opened is None or project_id != opened.id) and _uses(
                await self._storage.project(project_id), object_id
            ):
                found.add(project_id)
        if opened is not None and _uses(_with_changes(session.document, after) or opened, object_id):
            found.add(opened.id)
        return found


def _with_changes(document: Document, changes: Sequence[Change]) -> Project | None:
    """Return the project as it would be after changes; the document stays as it is."""
    document.apply(changes)
    try:
        return document.project
    finally:
        document.apply([change.inverse() for change in reversed(changes)])
