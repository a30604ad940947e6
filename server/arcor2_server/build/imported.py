"""Reads the files of a package to be imported."""

import ast
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath
from typing import Final, Literal, TypeVar

import msgspec
from msgspec import UNSET, field

from arcor2_hw.analysis import module_name
from arcor2_hw.data.base import Data, Unset, is_valid_name
from arcor2_hw.data.object_type import Model3dType, ObjectModel, ObjectTypeSource
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.data.texts import check_texts
from arcor2_hw.exceptions import InvalidData, InvalidPackage
from arcor2_hw.parsing import parse
from arcor2_hw.runtime.documents import decode_document
from arcor2_hw.runtime.type_files import own_modules, sibling_modules
from arcor2_server.build import package, snapshot

T = TypeVar("T")

MAX_ID: Final = 255
_Kind = Literal["type", "installed", "helper"]


class ImportedPackage(Data, frozen=True):
    """The documents of a package, checked without the documents of the server.

    Args:
        scene: the scene.
        project: the project.
        script: source code of the script.
        types: uploaded types and helper modules, by name.
        installed: types of drivers. The package has a copy of their folders.
        helpers: the names in `types` that are helper modules without a class of their name.
    """

    scene: Scene
    project: Project
    script: str
    types: dict[str, ObjectTypeSource] = field(default_factory=dict)
    installed: list[str] = field(default_factory=list)
    helpers: list[str] = field(default_factory=list)

    @property
    def needs_source(self) -> bool:
        """Whether the script is hand-written, not generated from the logic."""
        return not self.project.has_logic


def _wanted(path: PurePosixPath) -> bool:
    match path.parts:
        case ("script.py",) | ("data", "scene.json" | "project.json"):
            return True
        case (snapshot.FOLDER, name):
            return name.endswith(".py") and name != "__init__.py"
        case (snapshot.FOLDER, _, name):
            return name.endswith(".py")
        case ("data", "models", name):
            return name.endswith(".json")
    return False


def _document(files: Mapping[str, bytes], path: str, kind: type[T]) -> T:
    """Read a JSON document in snake_case or camelCase."""
    try:
        raw = files[path]
    except KeyError:
        raise InvalidPackage("The package has no {path}.", path=path) from None
    try:
        found = decode_document(raw, kind)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise InvalidPackage("{path} of the package is damaged: {reason}", path=path, reason=error) from error
    try:
        check_texts(found)
    except InvalidData as error:
        raise InvalidPackage("{path} of the package: {reason}", path=path, reason=error) from error
    return found


def _text(files: Mapping[str, bytes], path: str) -> str:
    try:
        return files[path].decode("utf-8-sig")  # some editors write a byte order mark
    except KeyError:
        raise InvalidPackage("The package has no {path}.", path=path) from None
    except UnicodeDecodeError as error:
        raise InvalidPackage("{path} of the package is not UTF-8 text: {reason}", path=path, reason=error) from error


def _folders(files: Mapping[str, bytes]) -> dict[str, dict[str, str]]:
    """Return the modules of the folders in the package of object types, by folder and module."""
    found: dict[str, dict[str, str]] = {}
    for path in files:
        match PurePosixPath(path).parts:
            case (snapshot.FOLDER, folder, name):
                found.setdefault(folder, {})[name.removesuffix(".py")] = _text(files, path)
    return found


def _class_in(path: str, stem: str, source: str) -> tuple[str, _Kind]:
    """Return the name of a module's type and the kind of the module.

    Returns:
        "type" if the module defines a class of its name, "installed" if it imports the class from a copied driver,
        "helper" if it has no such class.
    """
    try:
        tree = parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise InvalidPackage("{path} of the package is not valid Python: {reason}", path=path, reason=error) from error
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
    raise InvalidPackage("{path} of the package has no class whose name matches the file name.", path=path)


def read(data: Path | bytes) -> ImportedPackage:
    """Read a package from a zip file or its content.

    Raises:
        InvalidPackage: the package is damaged or contradictory.
        StorageError: the file cannot be read.
    """
    files = package.from_zip(data, _wanted)
    scene = _document(files, "data/scene.json", Scene)
    project = _document(files, "data/project.json", Project)
    for what, key in (("scene", scene.id), ("project", project.id)):
        if not key or len(key) > MAX_ID or not key.isprintable():
            raise InvalidPackage("The {what} of the package has an invalid id: {key!r}.", what=what, key=key[:80])
    source = _text(files, "script.py")
    types: dict[str, ObjectTypeSource] = {}
    installed: list[str] = []
    helpers: list[str] = []
    copied: set[str] = set()
    for path in sorted(path for path in files if PurePosixPath(path).parent.name == snapshot.FOLDER):
        text = _text(files, path)
        name, kind = _class_in(path, PurePosixPath(path).stem, text)
        if kind == "installed":
            installed.append(name)
            copied |= sibling_modules(text)
        else:
            if kind == "helper":
                helpers.append(name)
            types[name] = ObjectTypeSource(name, text, model=_model(files, name), modules={})
    for folder, texts in _folders(files).items():
        if "__init__" not in texts or folder in copied:
            continue  # the folder of an installed driver, or in one
        name, _ = _class_in(f"{snapshot.FOLDER}/{folder}/__init__.py", folder, text := texts["__init__"])
        types[name] = ObjectTypeSource(name, text, model=_model(files, name), modules=own_modules(texts))
    modules = {module_name(name) for name in (*types, *installed)}
    for path in files:
        if path.startswith("data/models/") and PurePosixPath(path).stem not in modules:
            raise InvalidPackage("{path} of the package does not belong to any of its object types.", path=path)
    content = ImportedPackage(scene, project, source, types, installed, helpers)
    names = project.project_objects_ids
    return content if isinstance(names, Unset) else with_helper_names(content, names)


def _model(files: Mapping[str, bytes], name: str) -> ObjectModel | Unset:
    path = f"data/models/{module_name(name)}.json"
    if path not in files:
        return UNSET
    model = _document(files, path, ObjectModel)
    if model.type is Model3dType.NONE:
        return UNSET
    if model.model().id != name:
        raise InvalidPackage(
            "{path} of the package is the model of {id}, not of {name}.", path=path, id=model.model().id, name=name
        )
    return model


def with_helper_names(content: ImportedPackage, known: Iterable[str]) -> ImportedPackage:
    """Rename helpers from their module names to the known names. The files have only module names."""
    modules = {module_name(name): name for name in known}
    names = {name: modules.get(name, name) for name in content.helpers}
    types = {names.get(name, name): source for name, source in content.types.items()}
    types = {name: msgspec.structs.replace(source, id=name) for name, source in types.items()}
    return msgspec.structs.replace(content, types=types, helpers=list(names.values()))
