"""Object types over REST: uploaded as source, listed, read, deleted (protocol, sections 9.1 and 13)."""

from typing import Any, Final

import msgspec
from litestar import Request, Response, delete, get, put
from litestar.params import FromPath
from msgspec import UNSET

from arcor2_hw.data.base import Data, Timestamp, Unset, is_valid_name
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.object_type import Model3dType, ObjectModel, ObjectTypeSource
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_server.rest.answers import ROLE, answer, refusal, services_of
from arcor2_server.rpc.registry import make_event

SERVICE: Final = "Project"
MAX_SOURCE: Final = 1024 * 1024
"""Bytes of one module: a driver of that size is not one device any more."""


class ModelReference(Data, frozen=True):
    """Names a stored model."""

    id: str
    type: Model3dType


class ObjectTypeDocument(Data, frozen=True, rename="camel"):
    """An object type as REST clients write it."""

    id: str
    name: str
    source: str
    description: str | Unset = UNSET
    model: ModelReference | Unset = UNSET
    created: Timestamp | Unset = UNSET
    modified: Timestamp | Unset = UNSET


class IdDescription(Data, frozen=True):
    """One entry of a list."""

    id: str
    name: str
    created: Timestamp | Unset = UNSET
    modified: Timestamp | Unset = UNSET
    description: str | Unset = UNSET


def _document(stored: ObjectTypeSource) -> ObjectTypeDocument:
    model = UNSET if isinstance(stored.model, Unset) else ModelReference(stored.id, stored.model.type)
    return ObjectTypeDocument(
        stored.id, stored.id, stored.source, stored.description, model, stored.created, stored.modified
    )


@get("/object-types", opt={ROLE: Role.OPERATOR}, status_code=200)
async def object_types(request: Request[Any, Any, Any]) -> Response[bytes]:
    """List the uploaded object types."""
    stored = await services_of(request).storage.object_types()
    return answer([IdDescription(t.id, t.id, t.created, t.modified, t.description) for t in stored])


@get("/object-types/{name:str}", opt={ROLE: Role.OPERATOR}, status_code=200)
async def object_type(request: Request[Any, Any, Any], name: FromPath[str]) -> Response[bytes]:
    """Give one uploaded object type with its source."""
    try:
        return answer(_document(await services_of(request).storage.object_type(name)))
    except Arcor2Error as error:
        return refusal(SERVICE, error)


@put("/object-types", opt={ROLE: Role.PROGRAMMER}, status_code=200)
async def put_object_type(request: Request[Any, Any, Any]) -> Response[bytes]:
    """Upload an object type, new or changed; answers the time of the change. Clients are told of what changed."""
    services = services_of(request)
    try:
        body = await request.body()
        if len(body) > 2 * MAX_SOURCE:
            raise InvalidData(f"An object type has at most {MAX_SOURCE} bytes of source.")
        try:
            document = msgspec.json.decode(body, type=ObjectTypeDocument)
        except msgspec.DecodeError as error:
            raise InvalidData(f"This is no object type: {error}.") from None
        if document.id != document.name or not is_valid_name(document.id):
            raise InvalidData(f"{document.id!r} cannot name an object type: id and name are the name of its class.")
        if len(document.source.encode(errors="replace")) > MAX_SOURCE:
            raise InvalidData(f"The source of {document.id} has more than {MAX_SOURCE} bytes.")
        source = ObjectTypeSource(document.id, document.source, document.description)
        if not isinstance(document.model, Unset):
            stored_model = await services.storage.model(document.model.id)
            source = msgspec.structs.replace(source, model=ObjectModel.of(stored_model))
        was_known = services.types.known(document.id)
        meta = await services.types.add(source)
    except Arcor2Error as error:
        return refusal(SERVICE, error)
    change = ChangeType.UPDATE if was_known else ChangeType.ADD
    services.hub.broadcast(make_event("ChangedObjectTypes", [meta], change))
    return answer((await services.storage.object_type(document.id)).modified)


@delete("/object-types/{name:str}", opt={ROLE: Role.PROGRAMMER}, status_code=200)
async def delete_object_type(request: Request[Any, Any, Any], name: FromPath[str]) -> Response[bytes]:
    """Delete an uploaded object type; a scene that uses it has a problem from then on."""
    services = services_of(request)
    try:
        meta = await services.types.remove(name)
    except Arcor2Error as error:
        return refusal(SERVICE, error)
    services.hub.broadcast(make_event("ChangedObjectTypes", [meta], ChangeType.REMOVE))
    return answer("ok")
