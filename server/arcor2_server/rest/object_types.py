"""Object types over REST (protocol, sections 9.1 and 13)."""

import asyncio
from dataclasses import dataclass
from typing import Final

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import Data, Timestamp, Unset, is_valid_name
from arcor2_hw.data.object_type import Model3dType, ObjectModel, ObjectTypeSource
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.models import MetaModel3d
from arcor2_server.rest.operations import operation
from arcor2_server.rest.scenes import STORAGE, IdDesc
from arcor2_server.storage import Storage
from arcor2_server.storage.assets import TooLarge

MAX_SOURCE: Final = 1024 * 1024
"""Maximum size of the modules of a type, bytes."""


class ObjectType(Data, frozen=True):
    """An object type with the source of the module that declares its class.

    Attributes:
        modules: Sources of the modules that belong to this type only, by name. In a request, an absent field leaves
            the stored ones.
    """

    id: str
    name: str
    source: str
    description: str | Unset = UNSET
    model: MetaModel3d | Unset = UNSET
    created: Timestamp | Unset = UNSET
    modified: Timestamp | Unset = UNSET
    modules: dict[str, str] | Unset = UNSET


def _document(stored: ObjectTypeSource) -> ObjectType:
    model = UNSET if isinstance(stored.model, Unset) else MetaModel3d(stored.id, stored.model.type)
    return ObjectType(
        stored.id,
        stored.id,
        stored.source,
        stored.description,
        model,
        stored.created,
        stored.modified,
        stored.modules,
    )


@dataclass(frozen=True, slots=True)
class ObjectTypeOperations:
    """Object types over REST (protocol, sections 9.1 and 13)."""

    _storage: Storage
    _types: ObjectTypes
    _type_notifications: TypeNotifications

    @operation("GET", "/api/translations/{language}", SERVER, Role.OPERATOR, plain=True, open=True)
    async def translations(self, language: str) -> dict[str, str]:
        """Return the translations of messages and of texts of installed types into a language, by English text."""
        from arcor2_server.object_types import translations  # not needed at the start of the server

        return await asyncio.to_thread(translations.into, language, self._types.installed_folders())

    @operation("GET", "/object-types", STORAGE, Role.OPERATOR)
    async def list_object_types(self) -> list[IdDesc]:
        """Return all uploaded object types."""
        stored = await self._storage.object_types()
        return [IdDesc(one.id, one.id, str(one.created), str(one.modified), one.description) for one in stored]

    @operation("GET", "/object-types/{obj_type_id}", STORAGE, Role.OPERATOR)
    async def get_object_type(self, obj_type_id: str) -> ObjectType:
        """Return an uploaded object type with its source."""
        return _document(await self._storage.object_type(obj_type_id))

    @operation("PUT", "/object-types", STORAGE, Role.PROGRAMMER, limit=2 * MAX_SOURCE)
    async def put_object_type(self, body: ObjectType) -> Timestamp:
        """Upload an object type, or a module that other object types import; return the time of the upload.

        The source is analysed, never imported. It replaces an installed type of the same name until it is deleted.
        Clients are notified within 0.5 s after the last upload, and before a scene is opened.
        """
        if body.id != body.name or not is_valid_name(body.id):
            raise InvalidData(
                "{id!r} cannot be the id of an object type. Id and name must be the name of its class.", id=body.id[:80]
            )
        source = ObjectTypeSource(body.id, body.source, body.description, modules=body.modules)
        for name in source.own_modules:
            if not is_valid_name(name) or name.startswith("__"):
                raise InvalidData("{id}: {name!r} is not a valid module name.", id=body.id, name=name[:80])
        if sum(len(text.encode()) for text in (body.source, *source.own_modules.values())) > MAX_SOURCE:
            raise TooLarge("The source of {id} has more than {max_source} bytes.", id=body.id, max_source=MAX_SOURCE)
        self._types.require_replaceable(body.id)
        if not isinstance(body.model, Unset) and body.model.type is not Model3dType.NONE:
            if body.model.id != body.id:
                raise InvalidData(
                    "The model of {id} must have the same id, not {other_id!r}.",
                    id=body.id,
                    other_id=body.model.id[:80],
                )
            model = await self._storage.model(body.id)
            if model.type() is not body.model.type:
                raise InvalidData(
                    "The model {id} is a {value}, not a {type_value}.",
                    id=body.id,
                    value=model.type().value,
                    type_value=body.model.type.value,
                )
            source = replace(source, model=ObjectModel.of(model))
        saved = await self._storage.put_object_type(source)
        await self._type_notifications.uploaded()
        return str(saved.modified)

    @operation("DELETE", "/object-types/{obj_type_id}", STORAGE, Role.PROGRAMMER)
    async def delete_object_type(self, obj_type_id: str) -> None:
        """Delete an uploaded object type. An installed type of the same name is available again.

        Scenes that use a missing type report a problem.
        """
        self._types.require_deletable(obj_type_id)
        await self._storage.delete_object_type(obj_type_id)
        await self._type_notifications.uploaded()
