"""Import of a package: its scene, project and object types go back among the saved documents."""

import ast
import asyncio
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, Final, Literal, TypeVar

import humps
import msgspec
from msgspec import UNSET, field

from arcor2_hw.analysis import SourceFile, module_name
from arcor2_hw.data.base import Data, Unset, is_valid_name
from arcor2_hw.data.object_type import Mesh, Model3dType, Models, ObjectModel, ObjectTypeSource
from arcor2_hw.data.project import END, START, Action, Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.data.texts import check_texts
from arcor2_hw.exceptions import Conflict, InvalidPackage, InvalidProject, NotFound, TextTooLong
from arcor2_server.build import package, script, snapshot
from arcor2_server.build.candidates import Candidates
from arcor2_server.build.reading import from_script
from arcor2_server.documents.checks import complete_parameters, project_problems
from arcor2_server.documents.renamed_actions import with_present_names

if TYPE_CHECKING:
    from arcor2_server.services import Services

T = TypeVar("T")

MAX_ID: Final = 255
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


class Imported(Data, frozen=True):
    """The content of a package as documents, checked as far as a package can be by itself.

    types: uploaded types and helpers, by name. installed: types whose driver the package carries a copy of.
    helpers: those of `types` that have no class of their name.
    """

    scene: Scene
    project: Project
    script: str
    types: dict[str, ObjectTypeSource] = field(default_factory=dict)
    installed: list[str] = field(default_factory=list)
    helpers: list[str] = field(default_factory=list)

    @property
    def needs_source(self) -> bool:
        """Tell whether the script is the program itself, not made from the logic."""
        return not self.project.has_logic


# ------------------------------------------------------------------------------------------------ reading
def _wanted(path: PurePosixPath) -> bool:
    match path.parts:
        case ("script.py",) | ("data", "scene.json" | "project.json"):
            return True
        case (snapshot.FOLDER, name):
            return name.endswith(".py") and name != "__init__.py"
        case ("data", "models", name):
            return name.endswith(".json")
    return False


def _document(files: Mapping[str, bytes], path: str, kind: type[T]) -> T:
    """Read a JSON document in snake_case or camelCase."""
    try:
        raw = files[path]
    except KeyError:
        raise InvalidPackage(f"The package has no {path}.") from None
    try:
        found = msgspec.json.decode(raw, type=kind)
    except (msgspec.MsgspecError, RecursionError) as error:
        try:
            found = msgspec.convert(humps.decamelize(msgspec.json.decode(raw)), kind)
        except (msgspec.MsgspecError, ValueError, RecursionError):
            raise InvalidPackage(f"{path} of the package is damaged: {error}") from error
    try:
        check_texts(found)
    except TextTooLong as error:
        raise InvalidPackage(f"{path} of the package: {error}") from error
    return found


def _text(files: Mapping[str, bytes], path: str) -> str:
    try:
        return files[path].decode("utf-8-sig")  # some editors put a mark in front
    except KeyError:
        raise InvalidPackage(f"The package has no {path}.") from None
    except UnicodeDecodeError as error:
        raise InvalidPackage(f"{path} of the package is no text: {error}") from error


_Kind = Literal["type", "installed", "helper"]


def _class_in(path: str, source: str) -> tuple[str, _Kind]:
    """Return the name of the type in a module; "installed" if the module only imports it from a copied driver.

    A module that has no class of its name is a helper of others.
    """
    stem = PurePosixPath(path).stem
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise InvalidPackage(f"{path} of the package is no Python: {error}") from error
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and module_name(node.name) == stem:
            return node.name, "type"
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.level:
            for alias in node.names:
                if module_name(alias.asname or alias.name) == stem:
                    return alias.asname or alias.name, "installed"
    if is_valid_name(stem) and module_name(stem) == stem:
        return stem, "helper"
    raise InvalidPackage(f"{path} of the package has no class that the file is named after.")


def read(data: Path | bytes) -> Imported:
    """Read a package. Raises InvalidPackage, StorageError."""
    files = package.from_zip(data, _wanted)
    scene = _document(files, "data/scene.json", Scene)
    project = _document(files, "data/project.json", Project)
    for what, key in (("scene", scene.id), ("project", project.id)):
        if not key or len(key) > MAX_ID or not key.isprintable():
            raise InvalidPackage(f"The {what} of the package has no usable id: {key[:80]!r}.")
    source = _text(files, "script.py")
    types: dict[str, ObjectTypeSource] = {}
    installed: list[str] = []
    helpers: list[str] = []
    for path in sorted(files):
        if not path.startswith(f"{snapshot.FOLDER}/"):
            continue
        text = _text(files, path)
        name, kind = _class_in(path, text)
        if kind == "installed":
            installed.append(name)
        else:
            if kind == "helper":
                helpers.append(name)
            types[name] = ObjectTypeSource(name, text, model=_model(files, name))
    modules = {module_name(name) for name in (*types, *installed)}
    for path in files:
        if path.startswith("data/models/") and PurePosixPath(path).stem not in modules:
            raise InvalidPackage(f"{path} of the package belongs to none of its object types.")
    given = Imported(scene, project, source, types, installed, helpers)
    extra = project.project_objects_ids
    return given if isinstance(extra, Unset) else _with_helpers_named(given, extra)


def _with_helpers_named(given: Imported, known: Iterable[str]) -> Imported:
    """Return the package with helpers under the names by which they are known: a file tells only that of a module."""
    modules = {module_name(name): name for name in known}
    names = {name: modules.get(name, name) for name in given.helpers}
    types = {names.get(name, name): one for name, one in given.types.items()}
    types = {name: msgspec.structs.replace(one, id=name) for name, one in types.items()}
    return msgspec.structs.replace(given, types=types, helpers=list(names.values()))


def _model(files: Mapping[str, bytes], name: str) -> ObjectModel | Unset:
    path = f"data/models/{module_name(name)}.json"
    if path not in files:
        return UNSET
    model = _document(files, path, ObjectModel)
    if model.type is Model3dType.NONE:
        return UNSET
    if model.model().id != name:
        raise InvalidPackage(f"{path} of the package is the model of {model.model().id}, not of {name}.")
    return model


# ------------------------------------------------------------------------------------------------ checking
def _check(given: Imported, types: Candidates) -> None:
    """Refuse what could not be opened, or run, once it is saved."""
    for name in given.types:
        if (problem := types.analysis(name).problem) is not None:
            raise InvalidPackage(f"The object type {name} of the package cannot be used: {problem}.")
    for name in dict.fromkeys([*given.installed, *(obj.type for obj in given.scene.objects)]):
        types.analysis(name)  # NotFound
    if problems := project_problems(given.scene, given.project, types):
        raise InvalidPackage(f"The project {given.project.name} of the package is not sound. {' '.join(problems)}")
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
                    f"The logic of the package leads from or to an action {place}, which is not there."
                )


def _checked(given: Imported, known: Sequence[SourceFile], options: ImportOptions) -> Imported:
    """Give what is to be saved, when all of it is sound."""
    types = Candidates(known, given.types)
    if options.update_project_from_script:
        given = msgspec.structs.replace(given, project=_from_script(given, types))
    _check(given, types)
    return given


def _from_script(given: Imported, types: Candidates) -> Project:
    """Give the project as the script has it, with what calls leave to a default filled in, as editors do."""
    if given.needs_source:
        raise InvalidProject(f"The project {given.project.name} has no logic that its script could be read back into.")
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


async def _saved(services: "Services", given: Imported) -> _Saved:
    storage = services.storage

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


class _Plan(Data, frozen=True):
    """What differs from what is saved, and so has to be written."""

    types: list[ObjectTypeSource]
    scene: bool
    project: bool
    source: bool


def _plan(given: Imported, saved: _Saved, options: ImportOptions) -> tuple[_Plan, list[str]]:
    """Give what to write, and a sentence for each thing that must not be overwritten."""
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


def _open_conflicts(services: "Services", plan: _Plan, given: Imported) -> list[str]:
    """Name what is open: saving it later would undo the import unseen."""
    session = services.session
    scene, project = session.scene, session.project
    found = []
    if plan.scene and scene is not None and scene.id == given.scene.id:
        found.append(f"The scene {scene.name} is open: close it first.")
    if (plan.project or plan.source) and project is not None and project.id == given.project.id:
        found.append(f"The project {project.name} is open: close it first.")
    return found


def _check_here(services: "Services", given: Imported) -> None:
    for one in given.types.values():
        mesh = UNSET if isinstance(one.model, Unset) else one.model.model()
        if isinstance(mesh, Mesh) and not services.assets.exists(mesh.asset_id):
            raise NotFound(f"The mesh of {one.id} needs the asset {mesh.asset_id!r}, which is not here.")


async def import_package(services: "Services", data: Path | bytes, options: ImportOptions) -> ImportedIds:
    """Save what a package (a zip, or the path of one) holds; nothing is saved before all of it is checked.

    All of it is saved in one transaction; what is saved already and equal is left as it is.
    Raises InvalidPackage for a damaged, too large or contradictory package, NotFound for an object type or asset that
    is neither in it nor here, Conflict naming everything that differs from what is saved or is open, InvalidProject
    naming what cannot be built or the line of a script that cannot be read back, StorageError.
    """
    given = await asyncio.to_thread(read, data)
    async with services.build.importing:
        given = _with_helpers_named(given, [one.id for one in await services.storage.object_types()])
        _check_here(services, given)
        given = await asyncio.to_thread(_checked, given, services.types.files(), options)
        plan, conflicts = _plan(given, await _saved(services, given), options)
        if conflicts := [*conflicts, *_open_conflicts(services, plan, given)]:
            raise Conflict(" ".join(conflicts))
        if plan != _Plan([], False, False, False):
            await _write(services, given, plan)
    return ImportedIds(given.scene.id, given.project.id)


async def _write(services: "Services", given: Imported, plan: _Plan) -> None:
    """Save all, or nothing; clients are told of the types soon after, or when something is opened."""
    storage = services.storage
    async with storage.together():
        for one in plan.types:
            await storage.put_object_type(one)
        if plan.scene:
            await storage.put_scene(given.scene)
        if plan.project:
            await storage.put_project(given.project)
        if plan.source:
            await storage.put_project_source(given.project.id, given.script)
    if plan.types:
        await services.type_news.taken(services)
