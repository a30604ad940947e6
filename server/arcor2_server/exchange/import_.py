"""Imports an export into a server. Differing items are refused unless they may be overwritten."""

import contextlib
import hashlib
import tempfile
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final, Literal

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.analysis import SourceFile
from arcor2_hw.client import Client, ResourceNotFound
from arcor2_hw.client.rest import Asset, Listed
from arcor2_hw.data.base import Data, Unset, new_id
from arcor2_hw.data.object_type import Models, ObjectTypeMeta, ObjectTypeSource
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Arcor2Error, Conflict, DeviceTimeout, InvalidPackage
from arcor2_hw.messages import Message
from arcor2_server.exchange.archive import Archive, AssetFile, with_needed
from arcor2_server.exchange.export import Exporter
from arcor2_server.exchange.rollback import Rollback
from arcor2_server.exchange.validation import AvailableTypes, find_problems

Part = Literal["all", "scene", "project", "types", "assets"]
"""The part of an export that may overwrite items on the server."""
ImportOutcome = Literal["new", "replaced", "same"]
HIDES_INSTALLED: Final = "hides the installed type until it is removed"
_UNTIMED: Final[dict[str, Any]] = {"created": UNSET, "modified": UNSET, "int_modified": UNSET}
GREETING_TIMEOUT: Final = 5.0
"""Time limit for the greeting of the server, which contains the open document, s."""


class Step(Data, frozen=True):
    """One item of an export, and its treatment by the import. `notice`: further information for the user."""

    verb: ImportOutcome
    kind: str
    name: str
    notice: str = ""


def renamed(archive: Archive, name: str) -> Archive:
    """Return a copy of the export, whose document has another name and a new id."""
    if archive.project is not None:
        return replace(archive, project=replace(archive.project, id=new_id("pro"), name=name))
    if archive.scene is not None:
        return replace(archive, scene=replace(archive.scene, id=new_id("scn"), name=name))
    raise InvalidPackage("an object type cannot be imported under another name")


class Importer:
    """Imports an export into a server."""

    def __init__(self, client: Client, archive: Archive, overwrite: Collection[Part]) -> None:
        self._client = client
        self._rest = client.rest
        self._exporter = Exporter(client)
        self._archive = archive
        self._overwrite = overwrite
        self._conflicts: list[str] = []
        self.steps: list[Step] = []
        self._work: list[Step] = []
        self._old_scene: Scene | None = None
        self._old_project: Project | None = None
        self._metas: dict[str, ObjectTypeMeta] = {}

    async def plan(self, installed: list[SourceFile]) -> list[Step]:
        """Return the steps of the import without changing anything.

        Raises:
            InvalidPackage: An entry is invalid; the message names the first one.
            Conflict: Items differ and may not be overwritten; the message names all of them.
        """
        archive = self._archive
        await self._check(installed)
        await self._plan_assets(archive.assets)
        await self._plan_types(archive.types)
        if archive.scene is not None:
            await self._plan_document("scene", archive.scene, await self._rest.scenes())
        if archive.project is not None:
            await self._plan_document("project", archive.project, await self._rest.projects())
        await self._check_open()
        if self._conflicts:
            raise Conflict(" ".join(self._conflicts))
        return self.steps

    async def _check(self, installed: list[SourceFile]) -> None:
        archive, client = self._archive, self._client
        metas = self._metas = {meta.type: meta for meta in await client.get_object_types()}
        uploaded = await self._exporter.uploaded()
        used = set() if archive.scene is None else {obj.type for obj in archive.scene.objects}
        actions = {
            name: {action.name: action for action in await client.get_actions(name)}
            for name in used & metas.keys() - archive.types.keys()
        }
        robots = {robot.type: robot for robot in await client.get_robot_meta()}
        # Sources of the export may import sources on the server.
        on_server = [SourceFile.of_upload(one) for name, one in uploaded.items() if name not in archive.types]
        local = [file for file in installed if file.name not in uploaded]
        known = AvailableTypes(archive, [*local, *on_server], metas, actions, robots)
        for finding in find_problems(archive, known, [asset.id for asset in await self._rest.assets()]):
            if finding.level == "error":
                raise InvalidPackage("{entry}: {text}", entry=finding.entry, text=finding.text)

    def _check_overwrite(self, part: Part, kind: str) -> None:
        if not {part, "all"} & set(self._overwrite):
            self._conflicts.append(f"{kind} exists and differs. Use --overwrite {part} to replace it.")

    def _note(self, kind: str, name: str, same: bool, new: bool, notice: str = "") -> None:
        step = Step("same" if same else "new" if new else "replaced", kind, name, notice)
        self.steps.append(step)
        if not same:
            self._work.append(step)

    async def _plan_assets(self, assets: dict[str, AssetFile]) -> None:
        existing = {asset.id for asset in await self._rest.assets()}
        with tempfile.TemporaryDirectory(prefix="arcor2-import-") as directory:
            for key, asset in assets.items():
                same = False
                if key in existing:
                    file = Path(directory) / "asset"
                    await self._rest.download_asset(key, file)
                    with file.open("rb") as content:
                        digest = hashlib.file_digest(content, "sha256").digest()
                    same = digest == hashlib.sha256(asset.content).digest()
                    if not same:
                        self._check_overwrite("assets", f"The asset {key}")
                self._note("asset", key, same, key not in existing)

    async def _plan_types(self, types: dict[str, ObjectTypeSource]) -> None:
        existing = await self._exporter.uploaded()
        for name in types:
            new, old = types[name], existing.get(name)
            same = old is not None and (old.code, old.model) == (new.code, new.model)
            if old is not None and not same:
                self._check_overwrite("types", f"The object type {name}")
            shadows = old is None and name in self._metas
            self._note("object type", name, same, old is None, HIDES_INSTALLED if shadows else "")

    async def _plan_document(
        self, kind: Literal["scene", "project"], given: Scene | Project, existing: list[Listed]
    ) -> None:
        old: Scene | Project | None = None
        if any(one.id == given.id for one in existing):
            if kind == "scene":
                old = self._old_scene = await self._rest.scene(given.id)
            else:
                old = self._old_project = await self._rest.project(given.id)
        if any(one.name == given.name and one.id != given.id for one in existing):
            self._conflicts.append(f"Another {kind} is named {given.name}. Use --name to import this one.")
        same = old is not None and replace(old, **_UNTIMED) == replace(given, **_UNTIMED)
        if kind == "project" and same:
            same = await self._same_attachments(given.id)
        if old is not None and not same:
            self._check_overwrite(kind, f"The {kind} {old.name}")
        self._note(kind, given.name, same, old is None)

    async def _same_attachments(self, key: str) -> bool:
        """Return whether the script, parameters and overrides stored next to the project are equal."""
        archive, rest = self._archive, self._rest
        if archive.script is not None:
            try:
                if await rest.project_script(key) != archive.script:
                    return False
            except ResourceNotFound:
                if archive.script:
                    return False
        stored = await rest.kept_parameters(key), await rest.kept_overrides(key)
        return stored == (archive.parameters, archive.overrides)

    async def _check_open(self) -> None:
        """Add a conflict for an open document, since saving it later would undo the import."""
        try:
            greeting = await self._client.next_event(timeout=GREETING_TIMEOUT)
        except DeviceTimeout:
            return
        opened: list[Scene | Project] = []
        if greeting.event == "OpenScene":
            opened = [greeting.data.scene]
        elif greeting.event == "OpenProject":
            opened = [greeting.data.scene, greeting.data.project]
        changed = {step.kind for step in self._work}
        for kind, given in (("scene", self._archive.scene), ("project", self._archive.project)):
            if given is not None and kind in changed and any(one.id == given.id for one in opened):
                self._conflicts.append(f"The {kind} {given.name} is open on the server. Close it first.")

    # -------------------------------------------------------------------------------- run
    async def run(self) -> None:
        """Run the planned steps, referenced items first; undo them if one fails.

        The message of the error lists the steps that were undone, and those that could not be undone.
        """
        rollback = Rollback()
        try:
            with tempfile.TemporaryDirectory(prefix="arcor2-import-") as directory:
                try:
                    await self._run(rollback, Path(directory))
                except BaseException as error:
                    outcome = await rollback.run()
                    if isinstance(error, Arcor2Error) and outcome:
                        message = Message.of("{problem} {outcome}", problem=error, outcome=outcome)
                        raise error.with_message(message) from error
                    raise
        finally:
            self._work.clear()

    async def _run(self, rollback: Rollback, directory: Path) -> None:
        archive = self._archive
        work = {(step.kind, step.name) for step in self._work}
        existing = {asset.id: asset for asset in await self._rest.assets()}
        for number, (key, asset) in enumerate(archive.assets.items()):
            if ("asset", key) in work:
                await self._put_asset(rollback, key, asset, existing.get(key), directory / str(number))
        for name in _bases_first(archive.types):
            if ("object type", name) in work:
                await self._put_type(rollback, archive.types[name])
        scene, project = archive.scene, archive.project
        if scene is not None and ("scene", scene.name) in work:
            await self._put_scene(rollback, scene)
        if project is not None and ("project", project.name) in work:
            await self._put_project(rollback, project)

    async def _put_asset(self, rollback: Rollback, key: str, asset: AssetFile, old: Asset | None, copy: Path) -> None:
        rest = self._rest
        if old is None:
            rollback.before_step(f"asset {key}", lambda: rest.delete_asset(key))
        else:
            await rest.download_asset(key, copy)
            name = key if isinstance(old.file_name, Unset) else old.file_name
            rollback.before_step(f"asset {key}", lambda: rest.upload_asset(key, copy, file_name=name, replace=True))
        await rest.upload_asset(key, asset.content, file_name=asset.file_name or key, replace=True)

    async def _put_type(self, rollback: Rollback, source: ObjectTypeSource) -> None:
        rest, name = self._rest, source.id
        old = (await self._exporter.uploaded()).get(name)
        what = f"object type {name}"
        model, old_model = _model(source), None if old is None else _model(old)
        if model is not None:
            if old_model is None:
                rollback.before_step(what, lambda: rest.delete_model(name))
            else:
                rollback.before_step(what, lambda: rest.put_model(old_model))
            await rest.put_model(model)
        if old is None:
            rollback.before_step(what, lambda: rest.delete_object_type(name))
        else:
            rollback.before_step(what, lambda: rest.put_object_type(name, old.source, old_model, old.own_modules))
        await rest.put_object_type(name, source.source, model, source.own_modules)

    async def _put_scene(self, rollback: Rollback, scene: Scene) -> None:
        rest, old = self._rest, self._old_scene
        if old is None:
            rollback.before_step(f"scene {scene.name}", lambda: rest.delete_scene(scene.id))
        else:
            rollback.before_step(f"scene {old.name}", lambda: rest.put_scene(old))
        await rest.put_scene(scene)

    async def _put_project(self, rollback: Rollback, project: Project) -> None:
        archive, rest, old, key = self._archive, self._rest, self._old_project, project.id
        script = None
        if old is None:
            rollback.before_step(f"project {project.name}", lambda: rest.delete_project(key))
        else:
            what = f"project {old.name}"
            parameters, overrides = await rest.kept_parameters(key), await rest.kept_overrides(key)
            with contextlib.suppress(ResourceNotFound):
                script = await rest.project_script(key)
            rollback.before_step(what, lambda: rest.put_kept_overrides(key, overrides))
            rollback.before_step(what, lambda: rest.put_kept_parameters(key, parameters))
            if script is not None:
                before = script
                rollback.before_step(what, lambda: rest.put_project_script(key, before))
            rollback.before_step(what, lambda: rest.put_project(old))
        await rest.put_project(project)
        if archive.script is not None:
            await rest.put_project_script(key, archive.script)
        await rest.put_kept_parameters(key, archive.parameters)
        await rest.put_kept_overrides(key, archive.overrides)


def _model(source: ObjectTypeSource) -> Models | None:
    return None if isinstance(source.model, Unset) else source.model.model()


def _bases_first(types: dict[str, ObjectTypeSource]) -> list[str]:
    """Sort the types so that imported ones come first, unless imports are cyclic."""
    return sorted(types, key=lambda name: len(with_needed([name], types)))
