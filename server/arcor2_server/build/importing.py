"""Imports a package: saves its scene, project and object types."""

import asyncio
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec import UNSET

from arcor2_hw.analysis import SourceFile
from arcor2_hw.data.base import Data, Unset
from arcor2_hw.data.object_type import Mesh, Models, ObjectTypeSource
from arcor2_hw.data.project import END, START, Action, Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Conflict, InvalidPackage, InvalidProject, NotFound
from arcor2_server.build import script
from arcor2_server.build.candidates import Candidates
from arcor2_server.build.imported import Imported, read, with_helpers_named
from arcor2_server.documents import Session
from arcor2_server.documents.checks import complete_parameters, project_problems
from arcor2_server.documents.renamed_actions import with_present_names
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.storage import AssetStore, Storage

_UNTIMED: Final = {"created": UNSET, "modified": UNSET, "int_modified": UNSET}


class ImportOptions(Data, frozen=True, rename="camel"):
    """What of the package may take the place of something else that is saved (protocol, section 11)."""

    overwrite_scene: bool = False
    overwrite_project: bool = False
    overwrite_object_types: bool = False
    overwrite_project_sources: bool = False
    overwrite_collision_models: bool = False
    update_project_from_script: bool = False


class ImportedIds(Data, frozen=True, rename="camel"):
    """What was imported; also the answer over REST."""

    scene_id: str
    project_id: str


# ------------------------------------------------------------------------------------------------ reading


# ------------------------------------------------------------------------------------------------ checking
def _check(given: Imported, types: Candidates) -> None:
    """Refuse documents that could not be opened or run after they are saved."""
    for name in given.types:
        if (problem := types.analysis(name).problem) is not None:
            raise InvalidPackage(
                "The object type {name} of the package cannot be used: {problem}.", name=name, problem=problem
            )
    for name in dict.fromkeys([*given.installed, *(obj.type for obj in given.scene.objects)]):
        types.analysis(name)  # NotFound
    if problems := project_problems(given.scene, given.project, types):
        raise InvalidPackage(
            "The project {name} of the package is not sound. {problems}",
            name=given.project.name,
            problems=" ".join(problems),
        )
    if given.needs_source:
        script.check_syntax(given.script)
    _check_logic(given.project)


def _check_logic(project: Project) -> None:
    """Refuse steps from or to nothing; whether the logic is finished is for Build to say."""
    known = {action.id for point in project.action_points for action in point.actions}
    for item in project.logic:
        for place in {item.start.partition("/")[0], item.end.partition("/")[0]} - {START, END}:
            if place not in known:
                raise InvalidPackage(
                    "The logic of the package leads from or to an action {place}, which is not there.", place=place
                )


def _checked(given: Imported, known: Sequence[SourceFile], options: ImportOptions) -> Imported:
    """Return the documents to save, if all of them are valid."""
    types = Candidates(known, given.types)
    if options.update_project_from_script:
        given = msgspec.structs.replace(given, project=_from_script(given, types))
    _check(given, types)
    return given


def _from_script(given: Imported, types: Candidates) -> Project:
    """Return the project according to the script, with default values filled in, as editors do."""
    from arcor2_server.build.reading import from_script  # a start of the server does without the seven modules

    if given.needs_source:
        raise InvalidProject(
            "The project {name} has no logic that its script could be read back into.", name=given.project.name
        )
    facts = types.facts(given.scene)
    project = from_script(given.script, given.scene, with_present_names(given.scene, given.project, types), facts)
    type_of = {obj.id: obj.type for obj in given.scene.objects}

    def filled(action: Action) -> Action:
        object_id, method = action.parse_type()
        return complete_parameters(action, facts[type_of[object_id]].actions[method])

    points = [
        msgspec.structs.replace(point, actions=[filled(action) for action in point.actions])
        for point in project.action_points
    ]
    return msgspec.structs.replace(project, action_points=points)


class _Saved(Data, frozen=True):
    """What is saved under the ids and names of a package, None for what is not."""

    scene: Scene | None
    project: Project | None
    source: str | None
    types: dict[str, ObjectTypeSource]
    models: dict[str, Models]
    scene_of_name: str | None
    project_of_name: str | None


class _Plan(Data, frozen=True):
    """What differs from what is saved, and so has to be written."""

    types: list[ObjectTypeSource]
    scene: bool
    project: bool
    source: bool


def _plan(given: Imported, saved: _Saved, options: ImportOptions) -> tuple[_Plan, list[str]]:
    """Return the plan, and a sentence for each item that must not be overwritten."""
    conflicts: list[str] = []

    def differs(what: str, option: str, allowed: bool) -> None:
        if not allowed:
            conflicts.append(f"{what} is saved already and differs ({option} would replace it).")

    written: list[ObjectTypeSource] = []
    for name, one in given.types.items():
        old = saved.types.get(name)
        model = UNSET if isinstance(one.model, Unset) else one.model.model()
        old_model = saved.models.get(name)
        other_model = not isinstance(model, Unset) and model != old_model
        if other_model and old_model is not None:
            differs(f"The collision model of {name}", "overwriteCollisionModels", options.overwrite_collision_models)
        lost_model = old is not None and isinstance(old.model, Unset) != isinstance(one.model, Unset)
        if old is not None and (old.source != one.source or lost_model):
            differs(f"The object type {name}", "overwriteObjectTypes", options.overwrite_object_types)
        if old is None or old.source != one.source or other_model or lost_model:
            kept = UNSET if old is None else old.description
            written.append(msgspec.structs.replace(one, description=kept))
    scene = saved.scene is None or _plain(saved.scene) != _plain(given.scene)
    if scene and saved.scene is not None:
        differs(f"The scene {saved.scene.name}", "overwriteScene", options.overwrite_scene)
    project = saved.project is None or _plain(saved.project) != _plain(given.project)
    if project and saved.project is not None:
        differs(f"The project {saved.project.name}", "overwriteProject", options.overwrite_project)
    source = given.needs_source and saved.source != given.script
    if source and saved.source is not None:
        differs(
            f"The script of the project {given.project.name}",
            "overwriteProjectSources",
            options.overwrite_project_sources,
        )
    for what, name, other, own in (
        ("scene", given.scene.name, saved.scene_of_name, given.scene.id),
        ("project", given.project.name, saved.project_of_name, given.project.id),
    ):
        if other is not None and other != own:
            conflicts.append(f"Another {what} is named {name}: rename one of them.")
    return _Plan(written, scene, project, source), conflicts


def _plain(document: Scene | Project) -> Scene | Project:
    return msgspec.structs.replace(document, **_UNTIMED)


class PackageImport:
    """Imports packages into the storage."""

    def __init__(
        self,
        storage: Storage,
        assets: AssetStore,
        types: ObjectTypes,
        session: Session,
        type_notifications: TypeNotifications,
    ) -> None:
        self._storage = storage
        self._assets = assets
        self._types = types
        self._session = session
        self._type_notifications = type_notifications
        self._importing = asyncio.Lock()
        """Held by the one import that is being checked and written."""

    async def _saved(self, given: Imported) -> _Saved:
        storage = self._storage

        async def or_none(asked: Any) -> Any:
            try:
                return await asked
            except NotFound:
                return None

        return _Saved(
            await or_none(storage.scene(given.scene.id)),
            await or_none(storage.project(given.project.id)),
            await or_none(storage.project_source(given.project.id)),
            {one.id: one for one in await storage.object_types()},
            {one.id: one for one in await storage.models()},
            await storage.scene_named(given.scene.name),
            await storage.project_named(given.project.name),
        )

    def _open_conflicts(self, plan: _Plan, given: Imported) -> list[str]:
        """Name the open documents: saving them later would silently undo the import."""
        session = self._session
        scene, project = session.scene, session.project
        found = []
        if plan.scene and scene is not None and scene.id == given.scene.id:
            found.append(f"The scene {scene.name} is open: close it first.")
        if (plan.project or plan.source) and project is not None and project.id == given.project.id:
            found.append(f"The project {project.name} is open: close it first.")
        return found

    def _check_here(self, given: Imported) -> None:
        for one in given.types.values():
            mesh = UNSET if isinstance(one.model, Unset) else one.model.model()
            if isinstance(mesh, Mesh) and not self._assets.exists(mesh.asset_id):
                raise NotFound(
                    "The mesh of {id} needs the asset {asset_id!r}, which is not here.",
                    id=one.id,
                    asset_id=mesh.asset_id,
                )

    async def import_package(self, data: Path | bytes, options: ImportOptions) -> ImportedIds:
        """Save the documents of a package in one transaction, after all of them are checked.

        Documents that are saved already and equal stay as they are.

        Args:
            data: the package as a zip, or the path of one.
            options: what the import may replace.

        Raises:
            InvalidPackage: the package is damaged, too large or contradictory.
            NotFound: an object type or asset is neither in the package nor on this server.
            Conflict: names everything that differs from what is saved, or is open.
            InvalidProject: names what cannot be built, or the line of a script that cannot be read back.
            StorageError: the documents cannot be saved.
        """
        given = await asyncio.to_thread(read, data)
        async with self._importing:
            given = with_helpers_named(given, [one.id for one in await self._storage.object_types()])
            self._check_here(given)
            given = await asyncio.to_thread(_checked, given, self._types.files(), options)
            plan, conflicts = _plan(given, await self._saved(given), options)
            if conflicts := [*conflicts, *self._open_conflicts(plan, given)]:
                raise Conflict(" ".join(conflicts))
            if plan != _Plan([], False, False, False):
                await self._write(given, plan)
        return ImportedIds(given.scene.id, given.project.id)

    async def _write(self, given: Imported, plan: _Plan) -> None:
        """Save all documents in one transaction. Clients are notified of the types soon after."""
        storage = self._storage
        async with storage.transaction():
            for one in plan.types:
                await storage.put_object_type(one)
            if plan.scene:
                await storage.put_scene(given.scene)
            if plan.project:
                await storage.put_project(given.project)
            if plan.source:
                await storage.put_project_source(given.project.id, given.script)
        if plan.types:
            await self._type_notifications.uploaded()
