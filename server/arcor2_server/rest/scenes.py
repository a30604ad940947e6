"""Scenes over REST (protocol, section 13)."""

import contextlib
from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.role import Role
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_hw.messages import Message
from arcor2_server.documents.checks.interlocks import interlock_problems, keep_interlocks
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.rest.operations import operation
from arcor2_server.storage import Storage

STORAGE = "Storage"
MAX_ID = 255


class IdDesc(Data, frozen=True):
    """Id, name, times and description of a stored document."""

    id: str
    name: str
    created: Timestamp
    modified: Timestamp
    description: str | Unset = UNSET


class PutQuery(Data, frozen=True):
    """`exact`: store the document exactly as it is in the body."""

    exact: bool = False


def keep_nodes(sent: Scene, stored: Scene) -> Scene:
    """Return a sent scene with the nodes of objects that it lacks, because its client does not know them.

    An empty name removes a node.
    """
    nodes = {obj.id: obj.node for obj in stored.objects}
    return replace(
        sent,
        objects=[
            replace(obj, node=nodes.get(obj.id, UNSET) if isinstance(obj.node, Unset) else obj.node or UNSET)
            for obj in sent.objects
        ],
    )


def check_id(key: str, what: str) -> None:
    """Raise InvalidData if an id cannot be used in the path of a route."""
    if not key or len(key) > MAX_ID or not key.isprintable() or "/" in key or key in (".", ".."):
        raise InvalidData(
            "{key!r} cannot be the id of a {what}. Use 1 to {longest_id} printable characters without a slash.",
            key=key[:80],
            what=what,
            longest_id=MAX_ID,
        )


@dataclass(frozen=True, slots=True)
class SceneOperations:
    """Scenes over REST (protocol, section 13)."""

    _storage: Storage
    _types: ObjectTypes

    @operation("GET", "/scenes", STORAGE, Role.OPERATOR)
    async def list_scenes(self) -> list[IdDesc]:
        """Return all saved scenes."""
        return [
            IdDesc(one.id, one.name, str(one.created), str(one.modified), one.description or UNSET)
            for one in await self._storage.scenes()
        ]

    @operation("GET", "/scenes/{scene_id}", STORAGE, Role.OPERATOR)
    async def get_scene(self, scene_id: str) -> Scene:
        """Return a saved scene."""
        return await self._storage.scene(scene_id)

    @operation("PUT", "/scenes", STORAGE, Role.TECHNICIAN)
    async def put_scene(self, body: Scene, query: PutQuery) -> Timestamp:
        """Save a new or changed scene; return the time. All its object types must be known.

        Interlocks and nodes of objects that the body lacks are kept, unless `exact`.
        """
        check_id(body.id, "scene")
        if not query.exact:
            with contextlib.suppress(NotFound):
                stored = await self._storage.scene(body.id)
                body = keep_nodes(keep_interlocks(body, stored), stored)
        if problems := interlock_problems(body, self._types):
            raise InvalidData(Message.joined(problems))
        for placed in body.objects:
            if not self._types.known(placed.type):
                raise NotFound("The object {name} has the unknown type {type!r}.", name=placed.name, type=placed.type)
        return str((await self._storage.put_scene(body)).modified)

    @operation("DELETE", "/scenes/{scene_id}", STORAGE, Role.TECHNICIAN)
    async def delete_scene(self, scene_id: str) -> None:
        """Delete a saved scene. Its projects cannot be opened afterwards."""
        await self._storage.delete_scene(scene_id)
