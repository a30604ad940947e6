"""Imports a package: saves its scene, project and object types."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec import UNSET

from arcor2_hw.analysis import SourceFile
from arcor2_hw.data.base import Data, Unset
from arcor2_hw.data.object_type import Mesh, Models, ObjectTypeSource
from arcor2_hw.data.project import END, START, Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Conflict, InvalidPackage, InvalidProject, NotFound
from arcor2_hw.messages import Message
from arcor2_server.build import script
from arcor2_server.build.combined_types import CombinedTypes
from arcor2_server.build.imported import ImportedPackage, read, with_helper_names
from arcor2_server.documents import Session
from arcor2_server.documents.checks.project import project_problems
from arcor2_server.documents.renamed_actions import with_present_names
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.storage import AssetStore, Storage

_WITHOUT_TIMES: Final = {"created": UNSET, "modified": UNSET, "int_modified": UNSET}


class ImportOptions(Data, frozen=True, rename="camel"):
    """Which saved documents the import may overwrite (protocol, section 11)."""

    overwrite_scene: bool = False
    overwrite_project: bool = False
    overwrite_object_types: bool = False
    overwrite_project_sources: bool = False
    overwrite_collision_models: bool = False
    update_project_from_script: bool = False


class ImportedIds(Data, frozen=True, rename="camel"):
    """The ids of the imported scene and project; also the response over REST."""

    scene_id: str
    project_id: str


def _check(package: ImportedPackage, types: CombinedTypes) -> None:
    """Raise an error for documents that could not be opened or run after they are saved."""
    for name in package.types:
        if (found := types.analysis(name)).problem is not None:
            raise InvalidPackage(
                "The object type {name} of the package cannot be used: {problem}.",
                name=found.meta.shown_name,
                problem=found.problem,
            )
    for name in dict.fromkeys([*package.installed, *(obj.type for obj in package.scene.objects)]):
        types.analysis(name)  # NotFound
    if problems := project_problems(package.scene, package.project, types):
        raise InvalidPackage(
            "The project {name} of the package has errors. {problems}",
            name=package.project.name,
            problems=Message.joined(problems),
        )
    if package.needs_source:
        script.check_syntax(package.script)
    _check_logic(package.project)


def _check_logic(project: Project) -> None:
    """Raise InvalidPackage for logic items of missing actions. Build checks whether the logic is complete."""
    of_program = [action for point in project.action_points for action in point.actions]
    parts = [(of_program, project.logic), *((function.actions, function.logic) for function in project.functions)]
    for actions, logic in parts:
        known = {START, END, *(action.id for action in actions)}
        for item in logic:
            if missing := {item.start.partition("/")[0], item.end.partition("/")[0]} - known:
                raise InvalidPackage(
                    "The logic of the package refers to the action {place}, which does not exist.", place=missing.pop()
                )


def _checked(package: ImportedPackage, known: Sequence[SourceFile], options: ImportOptions) -> ImportedPackage:
    """Check all documents; return those to save."""
    types = CombinedTypes(known, package.types)
    if options.update_project_from_script:
        package = msgspec.structs.replace(package, project=_from_script(package, types))
    _check(package, types)
    return package


def _from_script(package: ImportedPackage, types: CombinedTypes) -> Project:
    """Return the project updated from the script, with default values added, as editors do."""
    if package.needs_source:
        raise InvalidProject(
            "The project {name} has no logic, so its script cannot be converted to logic.", name=package.project.name
        )
    project = with_present_names(package.scene, package.project, types)
    return script.read_with_text(package.script, package.scene, project, types.facts(package.scene))


class _SavedDocuments(Data, frozen=True):
    """The saved documents with the ids and names of a package; None for missing ones."""

    scene: Scene | None
    project: Project | None
    source: str | None
    types: dict[str, ObjectTypeSource]
    models: dict[str, Models]
    scene_of_name: str | None
    project_of_name: str | None


class _Plan(Data, frozen=True):
    """The documents that differ from the saved ones and must be written."""

    types: list[ObjectTypeSource]
    scene: bool
    project: bool
    source: bool


def _plan(package: ImportedPackage, saved: _SavedDocuments, options: ImportOptions) -> tuple[_Plan, list[Message]]:
    """Return the plan, and a message for each document that must not be overwritten."""
    conflicts: list[Message] = []

    def differs(what: Message, option: str, allowed: bool) -> None:
        if not allowed:
            text = "{what} is already saved and differs. Set {option} to replace it."
            conflicts.append(Message.of(text, what=what, option=option))

    written: list[ObjectTypeSource] = []
    for name, one in package.types.items():
        old = saved.types.get(name)
        model = UNSET if isinstance(one.model, Unset) else one.model.model()
        old_model = saved.models.get(name)
        other_model = not isinstance(model, Unset) and model != old_model
        if other_model and old_model is not None:
            what = Message.of("The collision model of {name}", name=name)
            differs(what, "overwriteCollisionModels", options.overwrite_collision_models)
        lost_model = old is not None and isinstance(old.model, Unset) != isinstance(one.model, Unset)
        if old is not None and (old.code != one.code or lost_model):
            what = Message.of("The object type {name}", name=name)
            differs(what, "overwriteObjectTypes", options.overwrite_object_types)
        if old is None or old.code != one.code or other_model or lost_model:
            description = UNSET if old is None else old.description
            written.append(msgspec.structs.replace(one, description=description))
    scene = saved.scene is None or _without_times(saved.scene) != _without_times(package.scene)
    if scene and saved.scene is not None:
        what = Message.of("The scene {name}", name=saved.scene.name)
        differs(what, "overwriteScene", options.overwrite_scene)
    project = saved.project is None or _without_times(saved.project) != _without_times(package.project)
    if project and saved.project is not None:
        what = Message.of("The project {name}", name=saved.project.name)
        differs(what, "overwriteProject", options.overwrite_project)
    source = package.needs_source and saved.source != package.script
    if source and saved.source is not None:
        what = Message.of("The script of the project {name}", name=package.project.name)
        differs(what, "overwriteProjectSources", options.overwrite_project_sources)
    if saved.scene_of_name not in (None, package.scene.id):
        text = "Another scene has the name {name}. Rename one of them."
        conflicts.append(Message.of(text, name=package.scene.name))
    if saved.project_of_name not in (None, package.project.id):
        text = "Another project has the name {name}. Rename one of them."
        conflicts.append(Message.of(text, name=package.project.name))
    return _Plan(written, scene, project, source), conflicts


def _without_times(document: Scene | Project) -> Scene | Project:
    return msgspec.structs.replace(document, **_WITHOUT_TIMES)


@dataclass(frozen=True, slots=True)
class PackageImport:
    """Imports packages into the storage."""

    _storage: Storage
    _assets: AssetStore
    _types: ObjectTypes
    _session: Session
    _type_notifications: TypeNotifications
    _importing: asyncio.Lock = field(init=False, default_factory=asyncio.Lock)
    """Serializes imports."""

    async def _saved(self, package: ImportedPackage) -> _SavedDocuments:
        storage = self._storage

        async def or_none(document: Any) -> Any:
            try:
                return await document
            except NotFound:
                return None

        return _SavedDocuments(
            await or_none(storage.scene(package.scene.id)),
            await or_none(storage.project(package.project.id)),
            await or_none(storage.project_source(package.project.id)),
            {one.id: one for one in await storage.object_types()},
            {one.id: one for one in await storage.models()},
            await storage.scene_named(package.scene.name),
            await storage.project_named(package.project.name),
        )

    def _open_conflicts(self, plan: _Plan, package: ImportedPackage) -> list[Message]:
        """Return a message for each open document: saving it later would undo the import."""
        session = self._session
        scene, project = session.scene, session.project
        found = []
        if plan.scene and scene is not None and scene.id == package.scene.id:
            found.append(Message.of("The scene {name} is open. Close it first.", name=scene.name))
        if (plan.project or plan.source) and project is not None and project.id == package.project.id:
            found.append(Message.of("The project {name} is open. Close it first.", name=project.name))
        return found

    def _check_meshes(self, package: ImportedPackage) -> None:
        for one in package.types.values():
            mesh = UNSET if isinstance(one.model, Unset) else one.model.model()
            if isinstance(mesh, Mesh) and not self._assets.exists(mesh.asset_id):
                raise NotFound(
                    "The mesh of {id} needs the asset {asset_id!r}, which is not on this server.",
                    id=one.id,
                    asset_id=mesh.asset_id,
                )

    async def import_package(self, data: Path | bytes, options: ImportOptions) -> ImportedIds:
        """Check the documents of a package and save them in one transaction.

        Saved documents that are equal are not changed.

        Args:
            data: the package as a zip, or the path of one.
            options: which documents the import may overwrite.

        Raises:
            InvalidPackage: the package is damaged, too large or contradictory.
            NotFound: an object type or asset is neither in the package nor on this server.
            Conflict: documents differ from the saved ones or are open. The message lists all of them.
            InvalidProject: the project cannot be built, or the script cannot be converted to logic.
            StorageError: the documents cannot be saved.
        """
        package = await asyncio.to_thread(read, data)
        async with self._importing:
            package = with_helper_names(package, [stored.id for stored in await self._storage.object_types()])
            self._check_meshes(package)
            package = await asyncio.to_thread(_checked, package, self._types.files(), options)
            plan, conflicts = _plan(package, await self._saved(package), options)
            if conflicts := [*conflicts, *self._open_conflicts(plan, package)]:
                raise Conflict(Message.joined(conflicts))
            if plan != _Plan([], False, False, False):
                await self._write(package, plan)
        return ImportedIds(package.scene.id, package.project.id)

    async def _write(self, package: ImportedPackage, plan: _Plan) -> None:
        """Save all documents in one transaction, then notify clients of the object types."""
        storage = self._storage
        async with storage.transaction():
            for one in plan.types:
                await storage.put_object_type(one)
            if plan.scene:
                await storage.put_scene(package.scene)
            if plan.project:
                await storage.put_project(package.project)
            if plan.source:
                await storage.put_project_source(package.project.id, package.script)
        if plan.types:
            await self._type_notifications.uploaded()
