"""Takes secret settings out of documents that enter the server, and puts them back for the cell host.

Scenes, projects, packages and the journal hold a reference in place of each secret. They can be shown, logged and
exported as they are.
"""

import contextlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Protocol

import msgspec
from msgspec.structs import replace

from arcor2_hw.data.object_type import ObjectTypeMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride
from arcor2_hw.data.secret import HIDDEN, is_reference, is_secret_name, references_in
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.secret_store import SecretStore
from arcor2_server.session.changes import Change, Kind
from arcor2_server.session.journal_records import Recovered

PACKAGED: Final = ("scene.json", "project.json")
"""Documents in the folder `data` of a package that may hold settings."""
_WITH_SETTINGS: Final = frozenset({Kind.OBJECT, Kind.OVERRIDE})


class Types(Protocol):
    """What is needed of the registry of object types."""

    def meta(self, name: str) -> ObjectTypeMeta:
        """Return what is known of a type; NotFound."""

    def names(self) -> Iterable[str]:
        """Return the names of all types."""


class SettingSecrets:
    """Replaces values by references, and finds values by reference."""

    def __init__(self, types: Types, store: SecretStore) -> None:
        self._types = types
        self.store = store
        self._reuse = False

    @contextlib.contextmanager
    def migrating(self) -> Iterator[None]:
        """Use one reference for all equal values of a setting: stored documents stay equal to each other."""
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
        """Tell whether a setting is secret; of an unknown type, or an unknown setting, its name decides."""
        try:
            found = next((each for each in self._types.meta(type_name).settings if each.name == setting), None)
        except NotFound:
            found = None
        return is_secret_name(setting) if found is None else found.secret is True

    # ------------------------------------------------------------------------------------------ values to references
    def hide(self, type_name: str, given: Iterable[Parameter], before: Iterable[Parameter] = ()) -> list[Parameter]:
        """Return settings of an object with references in place of secrets; the values are stored by `flush`.

        before: the settings as they are. `***` keeps what is stored, else the driver's default counts. Raises
        InvalidData for a reference to the secret of another setting.
        """
        stored = {parameter.name: _text(parameter) for parameter in before}
        found = []
        for parameter in given:
            value = _text(parameter)
            if not value or not self.is_secret(type_name, parameter.name):
                found.append(parameter)
                continue
            known = stored.get(parameter.name) or ""
            known = known if is_reference(known) else ""
            if value == HIDDEN:
                if known:
                    found.append(_with(parameter, known))
                continue
            if is_reference(value):
                secret = self.store.find(value)
                if secret is not None and (secret.type, secret.setting) != (type_name, parameter.name):
                    raise InvalidData(f"The setting {parameter.name} refers to a secret of another setting. Enter it.")
                found.append(parameter)
                continue
            secret = self.store.find(known)
            if secret is None or secret.value != value:
                known = self.store.add(type_name, parameter.name, value, reuse=self._reuse)
            found.append(_with(parameter, known))
        return found

    def hide_in_object(self, obj: SceneObject, before: SceneObject | None = None) -> SceneObject:
        """Return an object of a scene without secrets; the same one when it has none."""
        given = list(obj.parameters)
        hidden = self.hide(obj.type, given, [] if before is None else before.parameters)
        return obj if hidden == given else replace(obj, parameters=hidden)

    def hide_in_scene(self, scene: Scene, before: Scene | None = None) -> Scene:
        """Return a scene without secrets; `before` is how it is stored."""
        stored = {} if before is None else {obj.id: obj for obj in before.objects}
        objects = [self.hide_in_object(obj, stored.get(obj.id)) for obj in scene.objects]
        return scene if objects == scene.objects else replace(scene, objects=objects)

    def hide_in_overrides(
        self,
        overrides: list[SceneObjectOverride],
        types: Mapping[str, str],
        before: Iterable[SceneObjectOverride] = (),
    ) -> list[SceneObjectOverride]:
        """Return overrides without secrets; `types` are the types of objects by id."""
        stored = {override.id: override.parameters for override in before}
        return [
            replace(each, parameters=self.hide(types.get(each.id, ""), each.parameters, stored.get(each.id, ())))
            for each in overrides
        ]

    async def take_from_scene(self, scene: Scene, before: Scene | None) -> Scene:
        """Return a scene without secrets, which are on disk then; `before` is how it is stored. StorageError."""
        hidden = self.hide_in_scene(scene, before)
        await self.store.flush()
        return hidden

    async def take_from_project(self, project: Project, scene: Scene, before: Project | None) -> Project:
        """Return a project on a scene without secrets, which are on disk then. StorageError."""
        stored = [] if before is None else before.object_overrides
        hidden = self.hide_in_overrides(project.object_overrides, types_of(scene), stored)
        await self.store.flush()
        return replace(project, object_overrides=hidden)

    def hide_in_journal(self, found: Recovered) -> Recovered:
        """Return what the journal holds without secrets; the same when it has none. StorageError."""
        values = [(item.kind, item.value) for item in found.items if item.kind in _WITH_SETTINGS]
        for edit in found.edits:
            for change in edit.changes:
                if change.kind in _WITH_SETTINGS:
                    values += [(change.kind, change.before), (change.kind, change.after)]
        types = {value.id: value.type for kind, value in values if kind is Kind.OBJECT and value is not None}

        def hidden(kind: Kind, value: Any) -> Any:
            if value is None or kind not in _WITH_SETTINGS:
                return value
            return self.hide_in_object(value) if kind is Kind.OBJECT else self.hide_in_overrides([value], types)[0]

        with self.migrating():
            if all(hidden(kind, value) == value for kind, value in values):
                return found
            items = [replace(item, value=hidden(item.kind, item.value)) for item in found.items]
            edits = [replace(edit, changes=[_hidden(each, hidden) for each in edit.changes]) for edit in found.edits]
        self.store.save()
        return replace(found, items=items, edits=edits)

    def hide_in_package(self, directory: Path) -> bool:
        """Replace secrets in the documents of a package on disk; tells whether there were any. Raises OSError.

        What cannot be read is left: the package does not run then.
        """
        documents: dict[str, Any] = {}
        for name in PACKAGED:
            try:
                documents[name] = msgspec.json.decode((directory / "data" / name).read_bytes())
            except (OSError, msgspec.DecodeError):
                documents[name] = None
        scene, project = documents.values()
        objects = _entries(scene, "objects")
        types = {each.get("id"): str(each.get("type", "")) for each in objects}
        changed = [self._hide_plain(types.get(each.get("id"), ""), each) for each in objects]
        overrides = [*_entries(project, "object_overrides"), *_entries(project, "objectOverrides")]
        changed += [self._hide_plain(types.get(each.get("id"), ""), each) for each in overrides]
        if not any(changed):
            return False
        self.store.save()
        for name, content in documents.items():
            if content is not None:
                path = directory / "data" / name
                fresh = path.with_name(f".{name}.new")
                fresh.write_bytes(msgspec.json.format(msgspec.json.encode(content)))
                fresh.replace(path)
        return True

    def _hide_plain(self, type_name: str, entry: dict[str, Any]) -> bool:
        try:
            given = msgspec.convert(entry.get("parameters", []), list[Parameter])
        except msgspec.ValidationError:
            return False
        hidden = self.hide(type_name, given)
        entry["parameters"] = msgspec.to_builtins(hidden)
        return hidden != given

    # ------------------------------------------------------------------------------------------ references to values
    def values_for(self, *documents: bytes) -> dict[str, str]:
        """Return the values of the references in encoded documents, as far as they are stored."""
        references = {reference for document in documents for reference in references_in(document)}
        secrets = {reference: self.store.find(reference) for reference in references}
        return {reference: secret.value for reference, secret in secrets.items() if secret is not None}

    def values_for_package(self, directory: Path) -> dict[str, str]:
        """Return the values of the references in a package. Reads files: call it in a thread."""
        paths = [directory / "data" / name for name in PACKAGED]
        return self.values_for(*(path.read_bytes() for path in paths if path.is_file()))


def _hidden(change: Change, hidden: Callable[[Kind, Any], Any]) -> Change:
    return replace(change, before=hidden(change.kind, change.before), after=hidden(change.kind, change.after))


def types_of(scene: Scene) -> dict[str, str]:
    """Return the types of the objects of a scene by id."""
    return {obj.id: obj.type for obj in scene.objects}


def _text(parameter: Parameter) -> str:
    """Return the value of a setting that is a text, else an empty one."""
    try:
        return msgspec.json.decode(parameter.value, type=str)
    except msgspec.DecodeError:
        return ""


def _with(parameter: Parameter, value: str) -> Parameter:
    return replace(parameter, value=msgspec.json.encode(value).decode())


def _entries(document: Any, key: str) -> list[dict[str, Any]]:
    found = document.get(key) if isinstance(document, dict) else None
    return [each for each in found if isinstance(each, dict)] if isinstance(found, list) else []
