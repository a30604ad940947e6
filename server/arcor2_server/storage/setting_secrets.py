"""Replaces secret settings in documents by references, and resolves references for the cell host.

Scenes, projects, packages and the journal contain a reference in place of each secret, so they can be shown, logged and
exported. A reference is valid only with the address that its value was entered for: a user who changes the host in the
settings of a device cannot have the password sent to another machine.
"""

import contextlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Protocol

import msgspec
from msgspec.structs import replace

from arcor2_hw.data.address import host_of, is_address_name
from arcor2_hw.data.base import Unset
from arcor2_hw.data.cell import Cell, parameters_of
from arcor2_hw.data.object_type import ObjectTypeMeta, ParameterMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride
from arcor2_hw.data.secret import HIDDEN, ObjectSecrets, is_reference, is_secret_name
from arcor2_hw.exceptions import AddressChanged, InvalidData, InvalidPackage, NotFound
from arcor2_hw.messages import Message
from arcor2_hw.runtime.documents import read_document
from arcor2_server.files import replace_file
from arcor2_server.storage.secret_store import Secret, SecretStore

PACKAGED: Final = ("scene.json", "project.json")
"""Documents in the folder `data` of a package that may hold settings."""
_UNKNOWN: Final = SceneObject("", "")


class Types(Protocol):
    """Access to the metadata of object types."""

    def meta(self, name: str) -> ObjectTypeMeta:
        """Return the metadata of a type. Raise NotFound if there is none."""

    def names(self) -> Iterable[str]:
        """Return the names of all types."""


class SettingSecrets:
    """Replaces secret values by references, and resolves references."""

    def __init__(self, types: Types, store: SecretStore, cell: Cell | None = None) -> None:
        self._types = types
        self._cell = cell
        self.store = store
        self._reuse = False

    @contextlib.contextmanager
    def migrating(self) -> Iterator[None]:
        """Use one reference for all equal values of a setting, so that equal stored documents stay equal."""
        self._reuse = True
        try:
            yield
        finally:
            self._reuse = False

    def declared(self) -> set[tuple[str, str]]:
        """Return object type and name of every secret setting."""
        return {
            (name, setting.name)
            for name in self._types.names()
            for setting in self._types.meta(name).settings
            if setting.secret is True
        }

    def is_secret(self, type_name: str, setting: str) -> bool:
        """Return whether a setting is secret. For an unknown type or setting, the name decides."""
        found = next((each for each in self._settings(type_name) if each.name == setting), None)
        return is_secret_name(setting) if found is None else found.secret is True

    def _settings(self, type_name: str) -> list[ParameterMeta]:
        try:
            return self._types.meta(type_name).settings
        except NotFound:
            return []

    def address(self, name: str, type_name: str, parameters: Iterable[Parameter]) -> str:
        """Return the hosts that an object connects to with these settings and those of the cell file."""
        settings = self._settings(type_name)
        texts = {each.name: _text(each.default_value) for each in settings if not isinstance(each.default_value, Unset)}
        texts |= {each.name: _text(each.value) for each in parameters}
        device = None if self._cell is None else self._cell.device(name)
        if device is not None and device.type == type_name:
            texts |= {each.name: _text(each.value) for each in parameters_of(device)}
        declared = {each.name: each.address for each in settings if not isinstance(each.address, Unset)}
        return ", ".join(
            host_of(text) for key, text in sorted(texts.items()) if text and declared.get(key, is_address_name(key))
        )

    # ------------------------------------------------------------------------------------------ values to references
    def hide(
        self,
        type_name: str,
        given: Iterable[Parameter],
        before: Iterable[Parameter] = (),
        *,
        name: str = "",
        below: Iterable[Parameter] = (),
        check: bool = False,
    ) -> list[Parameter]:
        """Return settings of an object with references in place of secrets. `flush` of the store writes the values.

        Args:
            type_name: The object's type.
            given: All its settings, or all its overrides.
            before: The stored settings or overrides. The value `***` keeps the stored secret, if there is one.
            name: The object's name.
            below: For overrides, the settings of the object in the scene.
            check: Refuse a reference to a secret that was entered for another address.

        Raises:
            InvalidData: A reference belongs to the secret of another setting.
            AddressChanged: A reference belongs to a secret for another address.
        """
        given, before, below = list(given), list(before), list(below)
        stored = {parameter.name: _text(parameter.value) for parameter in before}
        address = self.address(name, type_name, [*below, *given])
        if before or below:
            previous = self.address(name, type_name, [*below, *before])
            for reference in (*map(_text, (each.value for each in below)), *stored.values()):
                self.store.bind(reference, previous)
        found = []
        for parameter in given:
            value = _text(parameter.value)
            if not value or not self.is_secret(type_name, parameter.name):
                found.append(parameter)
                continue
            known = stored.get(parameter.name) or ""
            known = known if is_reference(known) else ""
            if value == HIDDEN:
                if not known:
                    continue
                value = known
            if is_reference(value):
                secret = self.store.bind(value, address)
                if secret is not None and (secret.type, secret.setting) != (type_name, parameter.name):
                    raise InvalidData(
                        "The setting {name} refers to the secret of another setting. Enter its value again.",
                        name=parameter.name,
                    )
                if check and secret is not None and secret.address != address:
                    raise AddressChanged(_enter_again(name or type_name, secret, address))
                found.append(_with(parameter, value))
                continue
            entered = Secret(type_name, parameter.name, value, address)
            if self.store.find(known) != entered:
                known = self.store.add(entered, reuse=self._reuse)
            found.append(_with(parameter, known))
        return found

    def hide_in_object(self, obj: SceneObject, before: SceneObject | None = None) -> SceneObject:
        """Return an object of a scene without secrets; `obj` itself if it has none.

        Raises:
            AddressChanged: The object has another address than `before`, and a secret for the old one.
        """
        given = list(obj.parameters)
        stored = [] if before is None else before.parameters
        old, new = (self.address(obj.name, obj.type, settings) for settings in (stored, given))
        hidden = self.hide(obj.type, given, stored, name=obj.name, check=before is not None and old != new)
        return obj if hidden == given else replace(obj, parameters=hidden)

    def hide_in_scene(self, scene: Scene, before: Scene | None = None) -> Scene:
        """Return a scene without secrets. `before` is the stored scene. Raise AddressChanged as `hide_in_object`."""
        stored = {} if before is None else objects_of(before)
        objects = [self.hide_in_object(obj, stored.get(obj.id)) for obj in scene.objects]
        return scene if objects == scene.objects else replace(scene, objects=objects)

    def hide_in_overrides(
        self,
        overrides: list[SceneObjectOverride],
        objects: Mapping[str, SceneObject],
        before: Iterable[SceneObjectOverride] = (),
    ) -> list[SceneObjectOverride]:
        """Return overrides without secrets. `objects`: the objects of the scene by id."""
        stored = {override.id: override.parameters for override in before}
        found = []
        for each in overrides:
            obj = objects.get(each.id, _UNKNOWN)
            hidden = self.hide(obj.type, each.parameters, stored.get(each.id, ()), name=obj.name, below=obj.parameters)
            found.append(replace(each, parameters=hidden))
        return found

    async def extract_from_scene(self, scene: Scene, before: Scene | None) -> Scene:
        """Store the secrets of a scene on disk and return the scene without them. `before` is the stored scene."""
        hidden = self.hide_in_scene(scene, before)
        await self.store.flush()
        return hidden

    async def extract_from_project(self, project: Project, scene: Scene, before: Project | None) -> Project:
        """Store the secrets of a project on disk and return the project without them."""
        stored = [] if before is None else before.object_overrides
        hidden = self.hide_in_overrides(project.object_overrides, objects_of(scene), stored)
        await self.store.flush()
        return replace(project, object_overrides=hidden)

    def hide_in_package(self, directory: Path) -> bool:
        """Replace secrets in the documents of a package on disk; return whether there were any.

        Unreadable documents are left unchanged. Such a package does not run.

        Raises:
            OSError: A document cannot be written.
        """
        documents: dict[str, Any] = {}
        for name in PACKAGED:
            try:
                documents[name] = msgspec.json.decode((directory / "data" / name).read_bytes())
            except (OSError, msgspec.DecodeError):
                documents[name] = None
        scene, project = documents.values()
        objects = {each.get("id"): each for each in _entries(scene, "objects")}
        changed = [self._hide_plain(each, each, []) for each in objects.values()]
        for override in [*_entries(project, "object_overrides"), *_entries(project, "objectOverrides")]:
            obj = objects.get(override.get("id"), {})
            changed.append(self._hide_plain(override, obj, _parameters(obj)))
        if not any(changed):
            return False
        self.store.save()
        for name, content in documents.items():
            if content is not None:
                path = directory / "data" / name
                replace_file(path, msgspec.json.format(msgspec.json.encode(content)), mode=0o666)
        return True

    def _hide_plain(self, entry: dict[str, Any], obj: dict[str, Any], below: list[Parameter]) -> bool:
        given = _parameters(entry)
        hidden = self.hide(str(obj.get("type", "")), given, name=str(obj.get("name", "")), below=below)
        if hidden != given:
            entry["parameters"] = msgspec.to_builtins(hidden)
        return hidden != given

    # ------------------------------------------------------------------------------------------ references to values
    def values_for(self, scene: Scene, overrides: Iterable[SceneObjectOverride] = ()) -> dict[str, ObjectSecrets]:
        """Return the stored secrets that were entered for the addresses of the objects, by object id.

        Objects that share an id are omitted, since the cell host cannot distinguish their secrets.
        Call `flush` of the store afterwards, since this may set the address of a secret.
        """
        overrides = list(overrides)
        count = Counter(obj.id for obj in scene.objects)
        found = {obj.id: self._values_for(obj, overrides) for obj in scene.objects if count[obj.id] == 1}
        return {key: secrets for key, secrets in found.items() if secrets is not None}

    def _values_for(self, obj: SceneObject, overrides: list[SceneObjectOverride]) -> ObjectSecrets | None:
        layers = [obj.parameters, *(each.parameters for each in overrides if each.id == obj.id)]
        parameters = {each.name: each for layer in layers for each in layer}
        address = self.address(obj.name, obj.type, parameters.values())
        values: dict[str, str] = {}
        problem: Message | None = None
        for key, parameter in parameters.items():
            secret = self.store.find(_text(parameter.value))
            if secret is None or (secret.type, secret.setting) != (obj.type, key):
                continue
            secret = self.store.bind(_text(parameter.value), address) or secret
            if secret.address == address:
                values[key] = secret.value
            else:
                problem = _enter_again(obj.name, secret, address)
        return ObjectSecrets(values, problem) if values or problem else None

    def values_for_package(self, directory: Path) -> dict[str, ObjectSecrets]:
        """Return the secrets of a package; empty if it is damaged. Accesses files, so call it in a thread."""
        try:
            scene = read_document(directory / "data" / PACKAGED[0], Scene)
            project = read_document(directory / "data" / PACKAGED[1], Project)
        except InvalidPackage:
            return {}
        found = self.values_for(scene, project.object_overrides)
        self.store.save()
        return found


def _enter_again(name: str, secret: Secret, address: str) -> Message:
    return Message.of(
        "Enter the {setting} of {name!r} again: its host changed from {before} to {after}.",
        setting=secret.setting,
        name=name,
        before=secret.address or Message.of("none"),
        after=address or Message.of("none"),
    )


def objects_of(scene: Scene) -> dict[str, SceneObject]:
    """Return the objects of a scene by id."""
    return {obj.id: obj for obj in scene.objects}


def _text(value: str) -> str:
    """Return the decoded value of a setting if it is a text, else an empty text."""
    try:
        return msgspec.json.decode(value, type=str)
    except msgspec.DecodeError:
        return ""


def _parameters(entry: dict[str, Any]) -> list[Parameter]:
    try:
        return msgspec.convert(entry.get("parameters", []), list[Parameter])
    except msgspec.ValidationError:
        return []


def _with(parameter: Parameter, value: str) -> Parameter:
    return replace(parameter, value=msgspec.json.encode(value).decode())


def _entries(document: Any, key: str) -> list[dict[str, Any]]:
    found = document.get(key) if isinstance(document, dict) else None
    return [each for each in found if isinstance(each, dict)] if isinstance(found, list) else []
