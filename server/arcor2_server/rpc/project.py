"""Requests that open, save, close, rename, copy and delete projects (protocol, 7.4)."""

import contextlib
from dataclasses import dataclass

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import new_id, now
from arcor2_hw.data.events import (
    ChangeType,
    MainScreen,
    NotificationData,
    NotificationLevel,
    OpenProjectData,
    SceneStateData,
    ShowMainScreenData,
)
from arcor2_hw.data.project import BareProject, Project, ProjectParameter
from arcor2_hw.data.rpc import (
    CloseProjectArgs,
    CopyProjectArgs,
    IdArgs,
    NewProjectArgs,
    RenameProjectArgs,
    UpdateProjectDescriptionArgs,
    UpdateProjectHasLogicArgs,
)
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import NotFound
from arcor2_hw.messages import Message
from arcor2_server.collaboration.locks import PROJECT, Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks.project import project_problems
from arcor2_server.documents.document import reduce_to
from arcor2_server.documents.extensions import extensions_of
from arcor2_server.documents.renamed_actions import with_present_names
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.rpc.scene import SceneRequests
from arcor2_server.storage import Storage


def _id_parameter(name: str, value: str) -> ProjectParameter:
    return ProjectParameter(name, "string", msgspec.json.encode(value).decode(), id=new_id("pco"))


@dataclass(frozen=True, slots=True)
class ProjectRequests:
    """Requests that open, save, close, rename, copy and delete projects (protocol, 7.4)."""

    _hub: EventHub
    _locks: Locks
    _storage: Storage
    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _type_notifications: TypeNotifications
    _editing: Editing
    _scene_requests: SceneRequests

    def _emit_opened(self, context: Context) -> None:
        session = self._session
        context.emit("OpenProject", OpenProjectData(session.require_scene(), session.require_project()))
        context.emit("SceneState", SceneStateData(self._online.state))

    def _require_no_project(self, context: Context) -> None:
        if (project := self._session.project) is not None:
            raise RequestRefused("The project {name} is open: close it first.", name=project.name)

    async def _scene_for(self, context: Context, scene_id: str) -> Scene:
        """Return the scene of a project: the open scene, or the saved one if no scene is open.

        Raises:
            NotFound: the scene does not exist.
            RequestRefused: another scene is open.
        """
        if (opened := self._session.scene) is None:
            return await self._storage.scene(scene_id)
        if opened.id != scene_id:
            raise RequestRefused(
                "The project belongs to another scene than {name}, which is open: close it first.", name=opened.name
            )
        return opened

    async def _save_scene_changes(self, context: Context) -> None:
        """Save the open scene if it has changes, since a project needs a saved scene."""
        if self._session.scene_changed:
            await self._scene_requests.save_open_scene(context)

    @rpc("NewProject")
    async def new_project(self, context: Context, args: NewProjectArgs) -> None:
        """Create a project and open it. It is stored when it is saved."""
        session = self._session
        self._require_no_project(context)
        async with self._locks.auto(context.user, PROJECT):
            self._editing.require_no_program()
            await self._editing.require_document_name_free(args.name, "project")
            if self._locks.write_locked_roots(excluding=(PROJECT,)):
                raise RequestRefused("An item is locked. All locks must be released first.")
            scene = await self._scene_for(context, args.scene_id)
            if problems := session.scene_problems(scene):
                raise RequestRefused(
                    "{name} cannot be opened. {problems}", name=scene.name, problems=Message.joined(problems)
                )
            # Another request may have opened a project meanwhile.
            self._require_no_project(context)
            if context.dry_run:
                return
            await self._save_scene_changes(context)
            key = new_id("pro")
            project = Project(
                name=args.name,
                scene_id=args.scene_id,
                description=args.description,
                has_logic=args.has_logic,
                int_modified=now(),
                id=key,
                parameters=[_id_parameter("scene_id", args.scene_id), _id_parameter("project_id", key)],
            )
            await session.show(session.scene or scene, project)
            self._emit_opened(context)

    @rpc("OpenProject")
    async def open_project(self, context: Context, args: IdArgs) -> None:
        """Open a saved project with its scene."""
        session = self._session
        async with self._editing.opening_allowed():
            self._require_no_project(context)
            project = await self._storage.project(args.id)
            scene = await self._scene_for(context, project.scene_id)
            await self._type_notifications.publish()
            if problems := project_problems(scene, project, self._types):
                raise RequestRefused(
                    "{name} cannot be opened. {problems}", name=project.name, problems=Message.joined(problems)
                )
            await self._save_scene_changes(context)
            await session.show(session.scene or scene, with_present_names(scene, project, self._types))
            self._emit_opened(context)
            self._notify_older_clients(project)

    def _notify_older_clients(self, project: Project) -> None:
        """Notify users whose clients do not know functions of the items that these clients cannot show or edit."""
        if not (parts := extensions_of(project)):
            return
        text = Message.of(
            "This project contains {parts}. Your client cannot show or edit them. They are kept when it saves.",
            parts=Message.listed(parts),
        )
        data = NotificationData(text.text, NotificationLevel.INFO, **text.translation())
        notice = make_event("Notification", data)
        for client in self._hub.clients - set(self._hub.subscribers("FunctionChanged")):
            self._hub.send(client, notice)

    @rpc("SaveProject")
    async def save_project(self, context: Context, args: None) -> None:
        """Save the open project."""
        session = self._session
        async with self._locks.exclusive():
            project = session.require_project()
            if not session.has_changes:
                raise RequestRefused("{name} has no changes to save.", name=project.name)
            if context.dry_run:
                return
            await self._scene_requests.save_project_and_scene(context)

    @rpc("CloseProject")
    async def close_project(self, context: Context, args: CloseProjectArgs) -> None:
        """Close the project and its scene."""
        session = self._session
        async with self._locks.exclusive():
            project = session.require_project()
            self._online.require_offline()
            if session.has_changes and not args.force:
                raise RequestRefused(
                    "{name} has unsaved changes. Save them, or close it with force.", name=project.name
                )
            if context.dry_run:
                return
            ids = [item.id for item in session.document.items()]
            await session.discard()
            self._locks.drop(ids)  # read locks do not prevent closing
        context.emit("ProjectClosed")
        context.emit("ShowMainScreen", ShowMainScreenData(MainScreen.PROJECTS_LIST, project.id))

    @rpc("RenameProject")
    async def rename_project(self, context: Context, args: RenameProjectArgs) -> None:
        """Rename a project."""
        await self._editing.require_document_name_free(args.new_name, "project")
        self._editing.require_locked(context, args.project_id)
        await self._update_base(context, args.project_id, name=args.new_name)
        if not context.dry_run:
            self._locks.release_announced(context.user, [args.project_id])

    @rpc("UpdateProjectDescription")
    async def update_project_description(self, context: Context, args: UpdateProjectDescriptionArgs) -> None:
        """Change the description of a project."""
        async with self._locks.auto(context.user, args.project_id):
            await self._update_base(context, args.project_id, description=args.new_description)

    @rpc("UpdateProjectHasLogic")
    async def update_project_has_logic(self, context: Context, args: UpdateProjectHasLogicArgs) -> None:
        """Set whether the program of a project is generated from its logic. If not, the logic is removed."""
        async with self._locks.auto(context.user, args.project_id):
            await self._update_base(context, args.project_id, has_logic=args.new_has_logic)

    async def _update_base(self, context: Context, project_id: str, **fields: str | bool) -> None:
        session, storage = self._session, self._storage
        without_logic = fields.get("has_logic") is False
        text = {"script": UNSET} if without_logic else {}
        document = session.document
        if (item := document.find(Kind.PROJECT, project_id)) is not None:
            changes = [document.update(Kind.PROJECT, project_id, replace(item.value, **fields, **text))]
            if without_logic:
                changes += [document.remove(Kind.LOGIC, step.id) for step in document.program_logic()]
            if await self._editing.commit(context, changes):
                context.emit_first("ProjectChanged", session.bare_project(), ChangeType.UPDATE_BASE)
            return
        project = await storage.project(project_id)
        if not context.dry_run:
            changed = replace(project, **fields, **text, **({"logic": []} if without_logic else {}))
            context.emit_first(
                "ProjectChanged", reduce_to(BareProject, await storage.put_project(changed)), ChangeType.UPDATE_BASE
            )

    @rpc("CopyProject")
    async def copy_project(self, context: Context, args: CopyProjectArgs) -> None:
        """Copy a saved project. Its items keep their ids. Existing clients expect the change type update_base."""
        storage = self._storage
        async with self._locks.auto(context.user, args.source_id):
            await self._editing.require_document_name_free(args.target_name, "copy of the project")
            source = await storage.project(args.source_id)
            key = new_id("pro")
            parameters = [
                replace(p, value=msgspec.json.encode(key).decode()) if p.name == "project_id" else p
                for p in source.parameters
            ]
            copied = replace(
                source, id=key, name=args.target_name, parameters=parameters, created=UNSET, modified=UNSET
            )
            if context.dry_run:
                return
            saved = await storage.put_project(copied)
            with contextlib.suppress(NotFound):  # a project with logic, or without a stored script
                await storage.put_project_source(key, await storage.project_source(source.id))
            context.emit_first("ProjectChanged", reduce_to(BareProject, saved), ChangeType.UPDATE_BASE)

    @rpc("DeleteProject")
    async def delete_project(self, context: Context, args: IdArgs) -> None:
        """Delete a saved project."""
        storage = self._storage
        self._require_no_project(context)
        async with self._locks.auto(context.user, args.id):
            project = await storage.project(args.id)
            if context.dry_run:
                return
            await storage.delete_project(args.id)
            context.emit("ProjectChanged", reduce_to(BareProject, project), ChangeType.REMOVE)
