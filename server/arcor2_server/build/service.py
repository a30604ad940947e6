"""The Build service: collects the parts of a project's package, generates the script, and writes the package."""

import asyncio
import contextlib
from collections.abc import Iterable

import msgspec
from msgspec import field

from arcor2_hw.analysis import Enumeration
from arcor2_hw.data.base import Data, Unset, new_id, now
from arcor2_hw.data.object_type import Model3dType, Models, ObjectAction, ObjectModel
from arcor2_hw.data.package import PackageMeta
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidProject, NotFound
from arcor2_hw.parsing import paused_garbage_collection
from arcor2_server.build import package, points, script, snapshot
from arcor2_server.build.frame import TypeFacts
from arcor2_server.build.zones import check_zones
from arcor2_server.documents.checks.interlocks import interlock_problems
from arcor2_server.documents.renamed_actions import with_present_names
from arcor2_server.object_types.catalog import PackageType
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage, package_versions


class BuildInput(Data, frozen=True):
    """The parts of a package. They are collected on the event loop; a thread generates the files."""

    name: str
    scene: Scene
    project: Project
    types: list[PackageType]
    facts: dict[str, TypeFacts]
    models: dict[str, ObjectModel]
    built: str
    enumerations: dict[str, list[Enumeration]] = field(default_factory=dict)
    """The enumerations of installed object types, by type, as the driver defines them."""
    source: str | None = None
    """The stored script of a project without logic, if there is one."""


def type_facts(
    types: ObjectTypes, scene: Scene, project: Project, code: Iterable[PackageType], *, all_actions: bool = False
) -> dict[str, TypeFacts]:
    """Return what the script needs to know about the types of a scene, with the actions that the project uses, or all.

    Args:
        types: the object types.
        scene: the scene of the project.
        project: the project.
        code: the code of the types in a package; a script imports the other types from the library.
        all_actions: whether to include the actions that the project does not use.
    """
    packaged = {packaged_type.name: packaged_type for packaged_type in code}
    type_of = {obj.id: obj.type for obj in scene.objects}
    actions: dict[str, dict[str, ObjectAction]] = {
        name: {each.name: each for each in types.actions(name)} if all_actions else {} for name in type_of.values()
    }
    for action in project.all_actions():
        object_id, _, method = action.type.partition("/")
        name = type_of.get(object_id)
        if name is None or method in actions[name]:
            continue
        try:
            actions[name][method] = types.action(name, method)
        except NotFound:
            continue  # `Frame.resolve` reports the missing action if the logic uses it
    facts: dict[str, TypeFacts] = {}
    for name, used in actions.items():
        code_of = packaged.get(name)
        module = f"{snapshot.FOLDER}.{code_of.module}" if code_of is not None else "arcor2_hw.objects"
        kinds = {key: kind for key, kind in types.enumerations(name).items() if key[0] in used}
        if code_of is not None and not code_of.source:
            # The copied driver folder may have another name; the module of the type imports the enumerations.
            kinds = {key: msgspec.structs.replace(kind, module=module) for key, kind in kinds.items()}
        facts[name] = TypeFacts(module, types.meta(name).shown_name, used, kinds, types.keyword_only(name))
    return facts


def package_code(types: ObjectTypes, names: Iterable[str], extra: Iterable[str] = ()) -> list[PackageType]:
    """Return the code of types for a package, with their bases: an uploaded type may derive from an installed one.

    `extra` are further uploaded sources, which may be helpers or mixins.
    """
    return types.sources_for([*(each for name in names for each in (*reversed(types.bases(name)), name)), *extra])


@paused_garbage_collection()
def files_of(inputs: BuildInput) -> dict[str, bytes]:
    """Return the files of a package (protocol, section 11).

    Raises:
        InvalidProject: the script cannot be generated, or the code of a type cannot be copied.
        NotFound: an object type is unknown.
    """
    project, scene = inputs.project, inputs.scene
    if project.has_logic:
        source = script.from_logic(scene, project, inputs.facts)
    elif inputs.source is not None:
        source = inputs.source
        script.check_syntax(source)
    else:
        source = script.without_logic(scene, project, inputs.facts)
    files = snapshot.files_of(inputs.types, inputs.enumerations)
    files |= {
        "script.py": source.encode(),
        "action_points.py": points.source(project).encode(),
        "data/scene.json": _document(scene),
        "data/project.json": _document(project),
        "package.json": _document(PackageMeta(inputs.name, inputs.built)),
    }
    for module, model in inputs.models.items():
        files[f"data/models/{module}.json"] = _document(model)
    files[package_versions.FILE] = _document(package_versions.present(snapshot.imported_packages(files)))
    return files


def _document(value: Data) -> bytes:
    return msgspec.json.format(msgspec.json.encode(value), indent=2) + b"\n"


class BuildService:
    """Builds packages. All methods raise NotFound (project, scene, object type), InvalidProject and StorageError."""

    def __init__(self, settings: ServerSettings, storage: Storage, types: ObjectTypes) -> None:
        self._settings = settings
        self._storage = storage
        self._types = types

    async def collect(self, project_id: str, package_name: str = "") -> BuildInput:
        """Return the parts of the package of a saved project. The default name is the name of the project."""
        storage, types = self._storage, self._types
        project = await storage.project(project_id)
        scene = await storage.scene(project.scene_id)
        project = with_present_names(scene, project, types)
        used = dict.fromkeys(obj.type for obj in scene.objects)
        for name in used:
            if (meta := types.meta(name)).disabled:
                raise InvalidProject(
                    "object type {name} cannot be used: {problem}", name=meta.shown_name, problem=meta.why_disabled
                )
        for problem in interlock_problems(scene, types):
            raise InvalidProject(problem)
        check_zones(scene, project, self._model_of, lambda name: types.derives_from(name, "Robot"))
        extra = [] if isinstance(project.project_objects_ids, Unset) else project.project_objects_ids
        code = package_code(types, used, extra)
        modules = {packaged_type.name: packaged_type.module for packaged_type in code}
        models = {
            modules[name]: model
            for name in used
            if name in modules and not isinstance(model := types.meta(name).object_model, Unset)
        }
        source: str | None = None
        if not project.has_logic:
            with contextlib.suppress(NotFound):
                source = await storage.project_source(project_id)
        return BuildInput(
            package_name or project.name,
            scene,
            project,
            code,
            type_facts(types, scene, project, code),
            models,
            now(),
            {name: list(types.enumerations(name).values()) for name in used},
            source,
        )

    def _model_of(self, name: str) -> Models | None:
        model = self._types.meta(name).object_model
        return None if isinstance(model, Unset) or model.type is Model3dType.NONE else model.model()

    async def build(self, project_id: str, package_name: str, package_id: str = "") -> str:
        """Store the package of a saved project and return its id. The default is a new id."""
        inputs = await self.collect(project_id, package_name)
        package_id = package_id or new_id("pkg")
        directory = self._settings.packages_dir / package_id
        await asyncio.to_thread(lambda: package.write(files_of(inputs), directory))
        return package_id

    async def publish(self, project_id: str, package_name: str = "") -> bytes:
        """Return the package of a saved project as a zip."""
        inputs = await self.collect(project_id, package_name)
        return await asyncio.to_thread(lambda: package.to_zip(files_of(inputs)))
