"""The Build service: collects what a project needs, generates its program, and writes the package."""

import asyncio
import contextlib
import gc
from collections.abc import Iterable, Iterator

import msgspec
from msgspec import field

from arcor2_hw.analysis import Enumeration
from arcor2_hw.data.base import Data, Unset, new_id, now
from arcor2_hw.data.object_type import ObjectAction, ObjectModel
from arcor2_hw.data.package import PackageMeta
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidProject, NotFound
from arcor2_server.build import package, points, script, snapshot
from arcor2_server.build.frame import TypeFacts
from arcor2_server.documents.renamed_actions import with_present_names
from arcor2_server.object_types.catalog import PackageType
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage, package_versions


class Ingredients(Data, frozen=True):
    """All that a package is made of. Gathered on the event loop, worked on beside it."""

    name: str
    scene: Scene
    project: Project
    types: list[PackageType]
    facts: dict[str, TypeFacts]
    models: dict[str, ObjectModel]
    built: str
    enumerations: dict[str, list[Enumeration]] = field(default_factory=dict)
    """By object type, for those whose code is copied from an installed driver, as the driver defines them."""
    source: str | None = None
    """The script of a project without logic, if one is stored."""


def _facts(types: ObjectTypes, scene: Scene, project: Project, code: Iterable[PackageType]) -> dict[str, TypeFacts]:
    """Return the facts that the script needs about the types: their modules, and the actions that the project uses."""
    carried = {one.name: one for one in code}
    type_of = {obj.id: obj.type for obj in scene.objects}
    actions: dict[str, dict[str, ObjectAction]] = {name: {} for name in type_of.values()}
    for point in project.action_points:
        for action in point.actions:
            object_id, _, method = action.type.partition("/")
            name = type_of.get(object_id)
            if name is None or method in actions[name]:
                continue
            try:
                actions[name][method] = types.action(name, method)
            except NotFound:
                continue  # refused where the logic uses it
    facts: dict[str, TypeFacts] = {}
    for name, used in actions.items():
        one = carried.get(name)
        module = f"{snapshot.FOLDER}.{one.module}" if one is not None else "arcor2_hw.objects"
        kinds = {key: kind for key, kind in types.enumerations(name).items() if key[0] in used}
        if one is not None and not one.source:
            # The copy of a driver's folder may be called otherwise; the type's own module gives them all.
            kinds = {key: msgspec.structs.replace(kind, module=module) for key, kind in kinds.items()}
        facts[name] = TypeFacts(module, used, kinds, types.keyword_only(name))
    return facts


def files_of(made_of: Ingredients) -> dict[str, bytes]:
    """Return the files of a package (protocol, section 11). Raise InvalidProject or NotFound if that is impossible."""
    project, scene = made_of.project, made_of.scene
    if project.has_logic:
        source = script.from_logic(scene, project, made_of.facts)
    elif made_of.source is not None:
        source = made_of.source
        script.check_syntax(source)
    else:
        source = script.without_logic(scene, project, made_of.facts)
    files = snapshot.files_of(made_of.types, made_of.enumerations)
    files |= {
        "script.py": source.encode(),
        "action_points.py": points.source(project).encode(),
        "data/scene.json": _document(scene),
        "data/project.json": _document(project),
        "package.json": _document(PackageMeta(made_of.name, made_of.built)),
    }
    for module, model in made_of.models.items():
        files[f"data/models/{module}.json"] = _document(model)
    files[package_versions.FILE] = _document(package_versions.present(snapshot.imported_packages(files)))
    return files


@contextlib.contextmanager
def _collector_waiting() -> Iterator[None]:
    """Keep the garbage collector from looking through a growing tree again and again.

    A tree has no cycles and goes by itself; of 10,000 actions it took 0.5 s more, in which nothing else ran either.
    """
    if not gc.isenabled():
        # Another build has it wait, and lets it go on.
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _document(value: Data) -> bytes:
    return msgspec.json.format(msgspec.json.encode(value), indent=2) + b"\n"


def _made(made_of: Ingredients) -> dict[str, bytes]:
    with _collector_waiting():
        return files_of(made_of)


class BuildService:
    """Builds packages. Errors: NotFound (project, scene, object type), InvalidProject, StorageError."""

    def __init__(self, settings: ServerSettings, storage: Storage, types: ObjectTypes) -> None:
        self._settings = settings
        self._storage = storage
        self._types = types

    async def gather(self, project_id: str, package_name: str = "") -> Ingredients:
        """Return the parts of a package of a saved project. Without a name it has the name of the project."""
        storage, types = self._storage, self._types
        project = await storage.project(project_id)
        scene = await storage.scene(project.scene_id)
        project = with_present_names(scene, project, types)
        used = dict.fromkeys(obj.type for obj in scene.objects)
        for name in used:
            if (meta := types.meta(name)).disabled:
                problem = "" if isinstance(meta.problem, Unset) else f": {meta.problem}"
                raise InvalidProject("object type {name} cannot be used{problem}", name=name, problem=problem)
        extra = [] if isinstance(project.project_objects_ids, Unset) else project.project_objects_ids
        # Bases too: an uploaded type may derive from an installed one.
        code = types.sources_for([*(each for name in used for each in (*reversed(types.bases(name)), name)), *extra])
        modules = {one.name: one.module for one in code}
        models = {
            modules[name]: model
            for name in used
            if name in modules and not isinstance(model := types.meta(name).object_model, Unset)
        }
        source: str | None = None
        if not project.has_logic:
            try:
                source = await storage.project_source(project_id)
            except NotFound:
                source = None
        return Ingredients(
            package_name or project.name,
            scene,
            project,
            code,
            _facts(types, scene, project, code),
            models,
            now(),
            {name: list(types.enumerations(name).values()) for name in used},
            source,
        )

    async def build(self, project_id: str, package_name: str, package_id: str = "") -> str:
        """Write the package of a saved project among the packages, under a new id unless one is given; gives the id."""
        made_of = await self.gather(project_id, package_name)
        package_id = package_id or new_id("pkg")
        directory = self._settings.packages_dir / package_id
        await asyncio.to_thread(lambda: package.write(_made(made_of), directory))
        return package_id

    async def publish(self, project_id: str, package_name: str = "") -> bytes:
        """Return the package of a saved project as a zip."""
        made_of = await self.gather(project_id, package_name)
        return await asyncio.to_thread(lambda: package.to_zip(_made(made_of)))
