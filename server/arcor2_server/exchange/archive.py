"""The export file, a zip: documents as JSON, object types as source, models and assets."""

from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath
from typing import Any, Final, Literal, TypeVar

import msgspec
from msgspec import UNSET, field

from arcor2_hw.analysis import module_name
from arcor2_hw.data.base import Data, Unset, is_valid_name
from arcor2_hw.data.object_type import Mesh, Model3dType, ObjectModel, ObjectTypeSource
from arcor2_hw.data.project import Project, ProjectParameter
from arcor2_hw.data.scene import Scene, SceneObjectOverride
from arcor2_hw.data.texts import check_texts
from arcor2_hw.exceptions import InvalidData, InvalidPackage, NotFound, StorageError
from arcor2_hw.runtime.type_files import shared_modules
from arcor2_server.build import imported, package
from arcor2_server.files import replace_file

T = TypeVar("T")
Kind = Literal["scene", "project", "object-type"]

FORMAT: Final = 1
"""Version of the export format."""
HEAD: Final = "export.json"
SCENE: Final = "data/scene.json"
PROJECT: Final = "data/project.json"
SCRIPT: Final = "script.py"
PARAMETERS: Final = "data/parameters.json"
OVERRIDES: Final = "data/object_parameters.json"
MAX_SIZE: Final = 512 * 1024 * 1024
"""Maximum size of the unpacked files, bytes. It is counted while unpacking, since a zip may state wrong sizes."""


class AssetFile(Data, frozen=True):
    """An asset: its content, and the name of the uploaded file."""

    content: bytes
    file_name: str = ""


class Archive(Data, frozen=True):
    """The content of an export file.

    Attributes:
        kind: The kind of the exported document.
        scene: The scene; None in an export of object types.
        project: The project; None in an export of a scene or of object types.
        script: The script of a project without logic.
        types: The uploaded object types by name, with their models.
        installed: Names of the object types that must be installed on the importing server.
        assets: Assets by id.
        parameters: Parameters stored next to the project.
        overrides: Overrides stored next to the project.
        from_package: The content was read from an execution package, which contains no assets.
    """

    kind: Kind
    scene: Scene | None = None
    project: Project | None = None
    script: str | None = None
    types: dict[str, ObjectTypeSource] = field(default_factory=dict)
    installed: list[str] = field(default_factory=list)
    assets: dict[str, AssetFile] = field(default_factory=dict)
    parameters: list[ProjectParameter] = field(default_factory=list)
    overrides: list[SceneObjectOverride] = field(default_factory=list)
    from_package: bool = False

    @property
    def name(self) -> str:
        """The name of the exported document."""
        document = self.project or self.scene
        return document.name if document is not None else next(iter(self.types), "")


class _Asset(Data, frozen=True):
    id: str
    file: str
    file_name: str = ""


class _Head(Data, frozen=True):
    """The content of export.json. `types`: class by file."""

    format: int
    kind: Kind
    types: dict[str, str] = field(default_factory=dict)
    installed: list[str] = field(default_factory=list)
    assets: list[_Asset] = field(default_factory=list)


# ------------------------------------------------------------------------------------------------ writing
def _json(value: Any) -> bytes:
    return msgspec.json.format(msgspec.json.encode(value), indent=2) + b"\n"


def files_of(archive: Archive) -> dict[str, bytes]:
    """Return the files of an export by path."""
    files: dict[str, bytes] = {}
    types: dict[str, str] = {}
    for name, one in archive.types.items():
        module = module_name(name)
        types[f"object_types/{module}.py"] = name
        files[f"object_types/{module}.py"] = one.source.encode()
        files |= {f"object_types/{module}/{own}.py": text.encode() for own, text in one.own_modules.items()}
        if not isinstance(one.model, Unset):
            files[f"data/models/{module}.json"] = _json(one.model)
    assets = []
    for number, (key, asset) in enumerate(sorted(archive.assets.items()), 1):
        path = f"assets/{number:04}"
        assets.append(_Asset(key, path, asset.file_name))
        files[path] = asset.content
    if archive.scene is not None:
        files[SCENE] = _json(archive.scene)
    if archive.project is not None:
        files[PROJECT] = _json(archive.project)
    if archive.script is not None:
        files[SCRIPT] = archive.script.encode()
    if archive.parameters:
        files[PARAMETERS] = _json(archive.parameters)
    if archive.overrides:
        files[OVERRIDES] = _json(archive.overrides)
    files[HEAD] = _json(_Head(FORMAT, archive.kind, types, sorted(archive.installed), assets))
    return files


def write(archive: Archive, path: Path) -> None:
    """Write the file atomically. Equal content results in equal bytes.

    Raises:
        StorageError: The file cannot be written.
    """
    try:
        replace_file(path, package.to_zip(files_of(archive)), mode=0o666, durable=False)
    except OSError as error:
        raise StorageError("{path} cannot be written: {reason}", path=path, reason=error.strerror or error) from error


# ------------------------------------------------------------------------------------------------ reading
def _wanted(path: PurePosixPath) -> bool:
    match path.parts:
        case ("export.json",) | ("script.py",):
            return True
        case ("data", name):
            return name.endswith(".json")
        case ("data", "models", name):
            return name.endswith(".json")
        case ("object_types", name):
            return name.endswith(".py") and name != "__init__.py"
        case ("object_types", _, name):
            return name.endswith(".py")
        case ("assets", _):
            return True
    return False


def _document(files: Mapping[str, bytes], path: str, kind: type[T]) -> T:
    try:
        found = msgspec.json.decode(files[path], type=kind)
        check_texts(found)
        if b"\\u" in files[path]:
            msgspec.json.encode(found)  # fails for a lone surrogate, which can be decoded but not encoded
        return found
    except InvalidData as error:
        raise InvalidPackage("{path}: {reason}", path=path, reason=error) from error
    except UnicodeError as error:
        raise InvalidPackage("{path}: it contains an invalid character: {reason}", path=path, reason=error) from error
    except KeyError:
        raise InvalidPackage("{path}: it is missing.", path=path) from None
    except (msgspec.MsgspecError, RecursionError) as error:
        # The message of msgspec contains the path of the value: `$.objects[2].pose.position`.
        raise InvalidPackage("{path}: {reason}", path=path, reason=error) from error


def _text(files: Mapping[str, bytes], path: str) -> str:
    try:
        return files[path].decode("utf-8-sig")
    except KeyError:
        raise InvalidPackage("{path}: it is missing.", path=path) from None
    except UnicodeDecodeError as error:
        raise InvalidPackage("{path}: it is not a text file: {reason}", path=path, reason=error) from error


def _types(files: Mapping[str, bytes], head: _Head) -> dict[str, ObjectTypeSource]:
    types: dict[str, ObjectTypeSource] = {}
    own: set[str] = set()
    for path, name in head.types.items():
        if not is_valid_name(name) or path != f"object_types/{module_name(name)}.py":
            raise InvalidPackage(
                "{head}: {path!r} is not the file of an object type {name!r}.",
                head=HEAD,
                path=path[:80],
                name=name[:80],
            )
        folder = f"{path.removesuffix('.py')}/"
        modules = {PurePosixPath(each).stem: _text(files, each) for each in files if each.startswith(folder)}
        types[name] = ObjectTypeSource(name, _text(files, path), model=_model(files, name), modules=modules)
        own |= {f"{folder}{each}.py" for each in modules if is_valid_name(each)}
    stray = {path for path in files if path.startswith("object_types/")} - head.types.keys() - own
    stray |= {path for path in files if path.startswith("data/models/")} - {_model_path(name) for name in types}
    if stray:
        raise InvalidPackage("{stray}: it belongs to no object type in {head}.", stray=min(stray), head=HEAD)
    return types


def _model_path(name: str) -> str:
    return f"data/models/{module_name(name)}.json"


def _model(files: Mapping[str, bytes], name: str) -> ObjectModel | Unset:
    path = _model_path(name)
    if path not in files:
        return UNSET
    model = _document(files, path, ObjectModel)
    if model.type is Model3dType.NONE:
        return UNSET
    if model.model().id != name:
        raise InvalidPackage(
            "{path}: it is the model of {id!r}, not of {name}.", path=path, id=model.model().id[:80], name=name
        )
    return model


def _checked_id(document: Scene | Project, path: str) -> None:
    key = document.id
    if not key or len(key) > imported.MAX_ID or not key.isprintable() or "/" in key or key in (".", ".."):
        raise InvalidPackage("{path}: {key!r} is not a valid id.", path=path, key=key[:80])


def read(path: Path) -> Archive:
    """Read an export file or an execution package, without unpacking it to disk or running its code.

    Raises:
        NotFound: The file does not exist.
        InvalidPackage: An entry is damaged; the message names it.
        StorageError: The file cannot be read.
    """
    if not path.is_file():
        raise NotFound("File {path} does not exist.", path=path)
    files = package.from_zip(path, _wanted, MAX_SIZE)
    if HEAD not in files:
        if {SCRIPT, PROJECT} <= files.keys():
            return _from_package(path)
        raise InvalidPackage("The file is not an export of arcor2-hw: {head} is missing.", head=HEAD)
    head = _document(files, HEAD, _Head)
    if head.format != FORMAT:
        raise InvalidPackage(
            "{head}: format {format} is not supported; this version reads format {other_format}.",
            head=HEAD,
            format=head.format,
            other_format=FORMAT,
        )
    scene = _document(files, SCENE, Scene) if head.kind != "object-type" else None
    project = _document(files, PROJECT, Project) if head.kind == "project" else None
    for document, place in ((scene, SCENE), (project, PROJECT)):
        if document is not None:
            _checked_id(document, place)
    types = _types(files, head)
    if head.kind == "object-type" and not types:
        raise InvalidPackage("{head}: it contains no object type.", head=HEAD)
    return Archive(
        head.kind,
        scene,
        project,
        _text(files, SCRIPT) if SCRIPT in files else None,
        types,
        head.installed,
        _assets(files, head.assets),
        _document(files, PARAMETERS, list[ProjectParameter]) if PARAMETERS in files else [],
        _document(files, OVERRIDES, list[SceneObjectOverride]) if OVERRIDES in files else [],
    )


def _assets(files: Mapping[str, bytes], named: Iterable[_Asset]) -> dict[str, AssetFile]:
    assets: dict[str, AssetFile] = {}
    for one in named:
        if one.file not in files or not one.file.startswith("assets/"):
            raise InvalidPackage(
                "{head}: the asset {id!r} should be in {file!r}, which is missing.",
                head=HEAD,
                id=one.id[:80],
                file=one.file[:80],
            )
        if one.id in assets:
            raise InvalidPackage("{head}: it contains the asset {id!r} twice.", head=HEAD, id=one.id[:80])
        assets[one.id] = AssetFile(files[one.file], one.file_name)
    return assets


def _from_package(path: Path) -> Archive:
    """Read an execution package. Its script is used only for a project without logic."""
    given = imported.read(path)
    return Archive(
        "project",
        given.scene,
        given.project,
        given.script if given.needs_source else None,
        given.types,
        given.installed,
        from_package=True,
    )


# ------------------------------------------------------------------------------------------------ dependencies
def with_needed(names: Iterable[str], sources: Mapping[str, ObjectTypeSource]) -> dict[str, ObjectTypeSource]:
    """Return the sources of these types and of the bases, mixins and other modules that they import."""
    of_module = {module_name(name): name for name in sources}
    chosen: dict[str, ObjectTypeSource] = {}
    waiting = sorted(set(names) & sources.keys(), reverse=True)
    while waiting:
        name = waiting.pop()
        if name in chosen:
            continue
        chosen[name] = sources[name]
        waiting += [of_module[module] for module in shared_modules(*sources[name].code) if module in of_module]
    return dict(sorted(chosen.items()))


def mesh_of(source: ObjectTypeSource) -> str | None:
    """Return the id of the asset that the model of a type needs."""
    if isinstance(source.model, Unset) or source.model.type is not Model3dType.MESH:
        return None
    model = source.model.model()
    return model.asset_id if isinstance(model, Mesh) else None
