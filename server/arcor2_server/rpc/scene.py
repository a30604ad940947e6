"""Requests that open, save, close, rename, copy and delete scenes (protocol, 7.2)."""

from dataclasses import dataclass

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import new_id
from arcor2_hw.data.events import ChangeType, MainScreen, OpenSceneData, SceneStateData, ShowMainScreenData
from arcor2_hw.data.object_type import ObjectTypeMeta
from arcor2_hw.data.rpc import (
    CloseSceneArgs,
    CopySceneArgs,
    IdArgs,
    NewSceneArgs,
    RenameArgs,
    UpdateSceneDescriptionArgs,
)
from arcor2_hw.data.scene import BareScene, Scene
from arcor2_hw.messages import Message
from arcor2_server.collaboration.locks import SCENE, Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.dependents import Dependents
from arcor2_server.documents.document import reduce_to
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.storage import Storage


@dataclass(frozen=True, slots=True)
class SceneRequests:
    """Requests that open, save, close, rename, copy and delete scenes (protocol, 7.2)."""

    _locks: Locks
    _storage: Storage
    _session: Session
    _online: OnlineScene
    _type_notifications: TypeNotifications
    _dependents: Dependents
    _editing: Editing

    def _emit_opened(self, context: Context, scene: Scene) -> None:
        context.emit("OpenScene", OpenSceneData(scene))
        context.emit("SceneState", SceneStateData(self._online.state))

    @rpc("NewScene")
    async def new_scene(self, context: Context, args: NewSceneArgs) -> None:
        """Create a scene and open it. It is stored when it is saved."""
        session = self._session
        async with self._editing.opening_allowed():
            session.require_nothing_open()
            await self._editing.require_document_name_free(args.name, "scene")
            if context.dry_run:
                return
            await self._type_notifications.publish()
            await session.show(Scene(name=args.name, description=args.description, id=new_id("scn")))
            self._emit_opened(context, session.require_scene())

    @rpc("OpenScene")
    async def open_scene(self, context: Context, args: IdArgs) -> None:
        """Open a saved scene."""
        session = self._session
        async with self._editing.opening_allowed():
            session.require_nothing_open()
            scene = await self._storage.scene(args.id)
            await self._type_notifications.publish()
            if problems := session.scene_problems(scene):
                raise RequestRefused(
                    "{name} cannot be opened. {problems}", name=scene.name, problems=Message.joined(problems)
                )
            await session.show(scene)
            self._emit_opened(context, session.require_scene())

    @rpc("CloseScene")
    async def close_scene(self, context: Context, args: CloseSceneArgs) -> None:
        """Close the open scene."""
        user = context.user
        async with self._locks.auto(user, SCENE):
            self._session.require_scene_alone()
            scene = self._session.require_scene()
            if self._session.scene_changed and not args.force:
                raise RequestRefused("{name} has unsaved changes. Save them, or close it with force.", name=scene.name)
            self._online.require_offline()
            if self._locks.locked_roots(excluding=(SCENE,)):
                raise RequestRefused("An item of the scene is locked. All locks must be released first.")
            if context.dry_run:
                return
            await self._session.discard()
        context.emit("SceneClosed")
        context.emit("ShowMainScreen", ShowMainScreenData(MainScreen.SCENES_LIST, scene.id))

    @rpc("SaveScene")
    async def save_scene(self, context: Context, args: None) -> None:
        """Save the open scene."""
        async with self._locks.exclusive():
            self._session.require_scene_alone()
            if context.dry_run:
                return
            await self.save_open_scene(context)

    async def save_open_scene(self, context: Context) -> None:
        """Save the open scene; update its projects, and delete generated object types that it no longer uses."""
        removed_types = await self._dependents.after_saving(self._session.save)
        context.emit("SceneSaved")
        self._emit_removed_types(context, removed_types)

    async def save_project_and_scene(self, context: Context) -> None:
        """Save the open project; if its scene has changes, also the scene, as `save_open_scene` does."""
        removed_types: list[ObjectTypeMeta] = []
        if self._session.scene_changed:
            removed_types = await self._dependents.after_saving(self._session.save)
        else:
            await self._session.save()
        context.emit("ProjectSaved")
        self._emit_removed_types(context, removed_types)

    def _emit_removed_types(self, context: Context, removed_types: list[ObjectTypeMeta]) -> None:
        if removed_types:
            context.emit("ChangedObjectTypes", removed_types, ChangeType.REMOVE)

    @rpc("RenameScene")
    async def rename_scene(self, context: Context, args: RenameArgs) -> None:
        """Rename a scene."""
        await self._editing.require_document_name_free(args.new_name, "scene")
        self._editing.require_locked(context, args.id)
        await self._update_base(context, args.id, name=args.new_name)
        if not context.dry_run:
            self._editing.unlock(context, args.id)

    @rpc("UpdateSceneDescription")
    async def update_scene_description(self, context: Context, args: UpdateSceneDescriptionArgs) -> None:
        """Change the description of a scene."""
        async with self._locks.auto(context.user, args.scene_id):
            await self._update_base(context, args.scene_id, description=args.new_description)

    async def _update_base(self, context: Context, scene_id: str, **fields: str) -> None:
        session = self._session
        if (item := session.document.find(Kind.SCENE, scene_id)) is not None:
            change = session.document.update(Kind.SCENE, scene_id, replace(item.value, **fields))
            if await self._editing.commit(context, [change]):
                context.emit_first("SceneChanged", session.bare_scene(), ChangeType.UPDATE_BASE)
            return
        scene = await self._storage.scene(scene_id)
        if not context.dry_run:
            saved = await self._storage.put_scene(replace(scene, **fields))
            context.emit_first("SceneChanged", reduce_to(BareScene, saved), ChangeType.UPDATE_BASE)

    @rpc("CopyScene")
    async def copy_scene(self, context: Context, args: CopySceneArgs) -> None:
        """Copy a saved scene. The objects keep their ids. Existing clients expect the change type update_base."""
        storage = self._storage
        async with self._locks.auto(context.user, args.source_id):
            await self._editing.require_document_name_free(args.target_name, "copy of the scene")
            source = await storage.scene(args.source_id)
            copied = replace(source, id=new_id("scn"), name=args.target_name, created=UNSET, modified=UNSET)
            if not context.dry_run:
                context.emit_first(
                    "SceneChanged", reduce_to(BareScene, await storage.put_scene(copied)), ChangeType.UPDATE_BASE
                )

    @rpc("DeleteScene")
    async def delete_scene(self, context: Context, args: IdArgs) -> None:
        """Delete a saved scene, with the object types that were generated for it."""
        self._session.require_nothing_open()
        async with self._locks.auto(context.user, args.id):
            scene = await self._storage.scene(args.id)
            if projects := await self._storage.projects_with_scene(args.id):
                raise RequestRefused(
                    "{name} is used by {count} projects: delete them first.",
                    projects,
                    name=scene.name,
                    count=len(projects),
                )
            if context.dry_run:
                return
            await self._storage.delete_scene(args.id)
            context.emit("SceneChanged", reduce_to(BareScene, scene), ChangeType.REMOVE)
            if removed := await self._dependents.delete_unused_types({obj.type for obj in scene.objects}):
                context.emit("ChangedObjectTypes", removed, ChangeType.REMOVE)

    @rpc("SceneObjectUsage")
    async def scene_object_usage(self, context: Context, args: IdArgs) -> set[str]:
        """Return the projects that use an object of the open scene, as parent of an action point or in an action."""
        self._session.require_scene_open()
        async with self._locks.read(context.user, args.id):
            return await self._dependents.uses_object(args.id)

    @rpc("ProjectsWithScene")
    async def projects_with_scene(self, context: Context, args: IdArgs) -> set[str]:
        """Return the saved projects of a scene."""
        async with self._locks.read(context.user, args.id):
            return set(await self._storage.projects_with_scene(args.id))
