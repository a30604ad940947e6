"""Preparation of instances from scene objects: class, constructor arguments and settings."""

import dataclasses
import enum
import importlib
import importlib.metadata
import importlib.util
import inspect
import sys
import tempfile
import typing
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import humps
import msgspec

from arcor2_hw import objects
from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.scene import SceneObject, SceneObjectOverride
from arcor2_hw.data.secret import ObjectSecrets, is_reference
from arcor2_hw.exceptions import AddressChanged, Arcor2Error, InvalidData, NotFound
from arcor2_hw.objects import CollisionObject, Generic, GenericWithPose, Settings
from arcor2_hw.runtime import older
from arcor2_hw.runtime.messages import TypeCode
from arcor2_hw.runtime.type_files import files_of_type

ENTRY_POINTS: Final = "arcor2_hw.object_types"
"""Entry point group of installed object types; the name of an entry is that of the type."""

_NO_SECRETS: Final = ObjectSecrets()

source_hooks: list[Callable[[], None]] = [older.install]
"""Functions called before the first uploaded source is imported: they provide the modules of older sources."""


def prepare_for_sources() -> None:
    """Prepare this process for importing uploaded sources. Call it before the first import."""
    for hook in source_hooks:
        hook()


def module_name(type_name: str) -> str:
    """Return the module name of an object type (protocol, section 9.1)."""
    return str(humps.depascalize(type_name))


# ------------------------------------------------------------------------------------------------ classes
def _class_of(module: ModuleType, name: str) -> type[Generic]:
    found = getattr(module, name, None)
    if not isinstance(found, type):
        raise NotFound("object type {name}: module {module} has no such class", name=name, module=module.__name__)
    if not issubclass(found, Generic):
        raise InvalidData("object type {name} does not derive from Generic", name=name)
    return found


def _import(module: str, type_name: str) -> ModuleType:
    try:
        return importlib.import_module(module)
    except Arcor2Error:
        raise
    except BaseException as error:  # importing an object type may raise any exception
        if isinstance(error, KeyboardInterrupt):
            raise
        detail = f"{type(error).__name__}: {error}"
        raise InvalidData(
            "object type {type_name} cannot be imported: {details}", module, type_name=type_name, details=detail
        ) from error


def shown_name(cls: type[Generic]) -> str:
    """Return the name of a type for users: its display name, or without one the name of the class."""
    return cls.__dict__.get("display_name") or cls.__name__


def write_sources(types: Iterable[TypeCode]) -> None:
    """Write uploaded sources as package `object_types` into a private directory and add that to the import path.

    The directory is kept for tracebacks of loaded types. The server removes it after the end of the host.
    """
    uploaded = [code for code in types if not code.entry_point and code.source]
    if not uploaded:
        return
    prepare_for_sources()
    root = tempfile.mkdtemp(prefix="arcor2-hw-types-")
    package = Path(root) / "object_types"
    package.mkdir()
    (package / "__init__.py").write_text("")
    for code in uploaded:
        module = code.module or module_name(code.name)
        for each in (module, *code.modules):
            if not each.isidentifier():
                raise InvalidData(
                    "object type {name}: {module!r} is not a valid module name", name=code.name, module=each
                )
        for path, text in files_of_type(module, code.source, code.modules).items():
            (package / path).parent.mkdir(exist_ok=True)
            (package / path).write_text(text, encoding="utf-8")
    for known in [name for name in sys.modules if name == "object_types" or name.startswith("object_types.")]:
        del sys.modules[known]
    sys.path.insert(0, root)
    importlib.invalidate_caches()


def load_type(code: TypeCode) -> type[Generic]:
    """Import an object type. Raises NotFound or InvalidData."""
    if code.entry_point:
        module, _, attribute = code.entry_point.partition(":")
        return _class_of(_import(module, code.name), attribute or code.name)
    if code.source:
        return _class_of(_import(f"object_types.{code.module or module_name(code.name)}", code.name), code.name)
    return find_type(code.name)


def find_type(name: str) -> type[Generic]:
    """Find an object type by name in the package `object_types`, the installed types or the base classes."""
    module = f"object_types.{module_name(name)}"
    try:
        here = importlib.util.find_spec(module) is not None
    except (ModuleNotFoundError, ValueError):
        here = False
    if here:
        return _class_of(_import(module, name), name)
    installed = importlib.metadata.entry_points(group=ENTRY_POINTS, name=name)
    for entry in installed:
        return _class_of(_import(entry.module, name), entry.attr or name)
    base = getattr(objects, name, None)
    if isinstance(base, type) and issubclass(base, Generic):
        return base
    raise NotFound("object type {name} is not installed and was not uploaded", name=name)


# ------------------------------------------------------------------------------------------------ settings
def settings_type(cls: type[Generic]) -> type[Settings] | None:
    """Return the dataclass of the settings of an object type, or None if it has none."""
    for base in cls.__mro__:
        constructor = base.__dict__.get("__init__")
        if constructor is None:
            continue
        try:
            hint = typing.get_type_hints(constructor).get("settings")
        except (NameError, TypeError, AttributeError) as error:
            raise InvalidData(
                "object type {cls}: the type hints of __init__ cannot be evaluated: {reason}",
                cls=shown_name(cls),
                reason=error,
            ) from error
        if hint is None:
            if any(p.kind is p.VAR_KEYWORD for p in inspect.signature(constructor).parameters.values()):
                continue  # this constructor passes its arguments to the next base class
            return None
        for candidate in (hint, *typing.get_args(hint)):
            if isinstance(candidate, type) and issubclass(candidate, Settings) and candidate is not Settings:
                return candidate
        return None
    return None


def _setting(hint: Any, parameter: Parameter) -> Any:
    value = msgspec.json.decode(parameter.value)
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return hint(value)
    if hint is bool and not isinstance(value, bool):
        raise ValueError(f"{value!r} is not a boolean")
    return msgspec.convert(value, hint)


def with_secrets(name: str, parameters: Mapping[str, Parameter], secrets: ObjectSecrets) -> dict[str, Parameter]:
    """Replace references to secrets by their values.

    Raises:
        AddressChanged: The secrets are withheld because the address of the device has changed.
        InvalidData: A secret is not stored.
    """
    found = dict(parameters)
    for key, parameter in parameters.items():
        if not is_reference(parameter.value.strip('"')):
            continue
        if key not in secrets.values:
            if secrets.problem is not None:
                raise AddressChanged(secrets.problem)
            raise InvalidData(
                "{name}: the secret setting {key} is not stored on this server. Enter it in the settings of {name}, "
                "or in the cell file.",
                name=name,
                key=key,
            )
        found[key] = Parameter(key, parameter.type, msgspec.json.encode(secrets.values[key]).decode())
    return found


def fill_settings(cls: type[Generic], name: str, parameters: Mapping[str, Parameter]) -> Settings | None:
    """Create the settings of an object from its parameters. Raises InvalidData."""
    kind = settings_type(cls)
    if kind is None:
        if parameters:
            raise InvalidData(
                "{name}: {cls} has no settings, but received {parameters}",
                name=name,
                cls=shown_name(cls),
                parameters=", ".join(parameters),
            )
        return None
    hints = typing.get_type_hints(kind)
    fields = {f.name: f for f in dataclasses.fields(kind) if f.init}
    values: dict[str, Any] = {}
    for parameter in parameters.values():
        if parameter.name not in fields:
            raise InvalidData(
                "{name}: {cls} has no setting {parameter_name}",
                name=name,
                cls=shown_name(cls),
                parameter_name=parameter.name,
            )
        try:
            values[parameter.name] = _setting(hints[parameter.name], parameter)
        except (msgspec.DecodeError, msgspec.ValidationError, ValueError, TypeError) as error:
            raise InvalidData(
                "{name}: setting {parameter_name}: {reason}",
                parameter.value,
                name=name,
                parameter_name=parameter.name,
                reason=error,
            ) from error
    missing = [
        f.name
        for f in fields.values()
        if f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING and f.name not in values
    ]
    if missing:
        raise InvalidData("{name}: setting {missing} is missing", name=name, missing=", ".join(missing))
    try:
        return kind(**values)
    except (ValueError, TypeError, AssertionError) as error:  # __post_init__ may check the values
        raise InvalidData("{name}: settings: {reason}", name=name, reason=error) from error


def address_of(settings: Settings | None) -> str:
    """Return the address of a device from its settings, for messages; empty if it has none."""
    if settings is None:
        return ""
    wanted = (
        "address",
        "host",
        "hostname",
        "ip",
        "url",
        "port",
        "device",
        "serial_port",
        "interface",
        "channel",
        "path",
    )
    given = dataclasses.asdict(settings)
    return ", ".join(f"{key} {given[key]}" for key in wanted if given.get(key) not in (None, ""))


# ------------------------------------------------------------------------------------------------ instances
class Remotes(typing.Protocol):
    """The objects of other hosts."""

    def make(self, of: SceneObject, cls: type[Generic], model: ObjectModel | None) -> Generic:
        """Return a stub of an object."""

    def follow(self, object_id: str, changed: Callable[[], None]) -> None:
        """Call a function when the state of an object has changed."""


@dataclasses.dataclass(frozen=True, slots=True)
class Recipe:
    """Class and constructor arguments of one instance. remotes: creates a stub if another host has the object."""

    scene_object: SceneObject
    cls: type[Generic]
    arguments: tuple[Any, ...]
    keywords: Mapping[str, Any]
    address: str
    remotes: Remotes | None = None

    def make(self) -> Generic:
        """Call the constructor, or return a stub of an object of another host."""
        if self.remotes is not None:
            return self.remotes.make(self.scene_object, self.cls, *self.arguments)
        return self.cls(*self.arguments, **self.keywords)


def recipe(
    scene_object: SceneObject,
    cls: type[Generic],
    model: ObjectModel | None,
    overrides: Iterable[SceneObjectOverride] = (),
    secrets: ObjectSecrets = _NO_SECRETS,
) -> Recipe:
    """Return the recipe of an object (protocol, section 9.2). Raises InvalidData.

    secrets: values of the secret settings of the object.
    """
    name = scene_object.name
    if cls.abstract():
        raise InvalidData("{name}: object type {cls} is abstract", name=name, cls=shown_name(cls))
    parameters = {parameter.name: parameter for parameter in scene_object.parameters}
    for override in overrides:
        if override.id == scene_object.id:
            parameters |= {parameter.name: parameter for parameter in override.parameters}
    settings = fill_settings(cls, name, with_secrets(name, parameters, secrets))
    arguments: list[Any] = [scene_object.id, name]
    if issubclass(cls, GenericWithPose):
        if isinstance(scene_object.pose, Unset):
            raise InvalidData("{name}: {cls} needs a pose", name=name, cls=shown_name(cls))
        arguments.append(scene_object.pose)
        if issubclass(cls, CollisionObject):
            arguments.append(None if model is None or model.type.value == "None" else model.model())
    keywords = {} if settings is None else {"settings": settings}
    return Recipe(scene_object, cls, tuple(arguments), keywords, address_of(settings))
