"""Collision models over REST (protocol, section 13). A model of any type has a unique id."""

from dataclasses import dataclass

from arcor2_hw.data.base import Data
from arcor2_hw.data.object_type import Box, Cylinder, Mesh, Model3dType, Models, Sphere
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.rest.operations import operation
from arcor2_server.rest.scenes import STORAGE, check_id
from arcor2_server.storage import Storage


class MetaModel3d(Data, frozen=True):
    """Id and type of a stored collision model."""

    id: str
    type: Model3dType


@dataclass(frozen=True, slots=True)
class ModelOperations:
    """Collision models over REST (protocol, section 13)."""

    _storage: Storage
    _type_notifications: TypeNotifications

    @operation("GET", "/models", STORAGE, Role.OPERATOR)
    async def list_models(self) -> list[MetaModel3d]:
        """Return all collision models."""
        return [MetaModel3d(model.id, model.type()) for model in await self._storage.models()]

    @operation("GET", "/models/meshes", STORAGE, Role.OPERATOR)
    async def list_meshes(self) -> list[Mesh]:
        """Return all collision models that are meshes."""
        return [model for model in await self._storage.models() if isinstance(model, Mesh)]

    async def _put(self, model: Models) -> None:
        check_id(model.id, "model")
        await self._storage.put_model(model)
        await self._type_notifications.uploaded()

    @operation("PUT", "/models/box", STORAGE, Role.TECHNICIAN)
    async def put_box_model(self, body: Box) -> None:
        """Save a box. It replaces a collision model with the same id."""
        await self._put(body)

    @operation("PUT", "/models/cylinder", STORAGE, Role.TECHNICIAN)
    async def put_cylinder_model(self, body: Cylinder) -> None:
        """Save a cylinder. It replaces a collision model with the same id."""
        await self._put(body)

    @operation("PUT", "/models/sphere", STORAGE, Role.TECHNICIAN)
    async def put_sphere_model(self, body: Sphere) -> None:
        """Save a sphere. It replaces a collision model with the same id."""
        await self._put(body)

    @operation("PUT", "/models/mesh", STORAGE, Role.TECHNICIAN)
    async def put_mesh_model(self, body: Mesh) -> None:
        """Save a mesh. It replaces a collision model with the same id."""
        await self._put(body)

    @operation("DELETE", "/models/{model_id}", STORAGE, Role.TECHNICIAN)
    async def delete_model(self, model_id: str) -> None:
        """Delete a collision model."""
        await self._storage.delete_model(model_id)
        await self._type_notifications.uploaded()

    async def _of_kind(self, key: str, kind: Model3dType) -> Models:
        model = await self._storage.model(key)
        if model.type() is not kind:
            raise NotFound(
                "The model {key} is a {value}, not a {other_value}.",
                key=key,
                value=model.type().value.lower(),
                other_value=kind.value.lower(),
            )
        return model

    @operation("GET", "/models/{model_id}/{model_type}", STORAGE, Role.OPERATOR)
    async def get_model(self, model_id: str, model_type: str) -> Models:
        """Return a collision model of a given type: box, cylinder, sphere or mesh."""
        try:
            kind = Model3dType(model_type.capitalize())
        except ValueError:
            raise InvalidData("Model type {model_type!r} does not exist.", model_type=model_type[:40]) from None
        return await self._of_kind(model_id, kind)

    @operation("GET", "/models/{model_id}/box", STORAGE, Role.OPERATOR)
    async def get_box(self, model_id: str) -> Box:
        """Return a box."""
        model = await self._of_kind(model_id, Model3dType.BOX)
        assert isinstance(model, Box)
        return model

    @operation("GET", "/models/{model_id}/cylinder", STORAGE, Role.OPERATOR)
    async def get_cylinder(self, model_id: str) -> Cylinder:
        """Return a cylinder."""
        model = await self._of_kind(model_id, Model3dType.CYLINDER)
        assert isinstance(model, Cylinder)
        return model

    @operation("GET", "/models/{model_id}/sphere", STORAGE, Role.OPERATOR)
    async def get_sphere(self, model_id: str) -> Sphere:
        """Return a sphere."""
        model = await self._of_kind(model_id, Model3dType.SPHERE)
        assert isinstance(model, Sphere)
        return model

    @operation("GET", "/models/{model_id}/mesh", STORAGE, Role.OPERATOR)
    async def get_mesh(self, model_id: str) -> Mesh:
        """Return a mesh."""
        model = await self._of_kind(model_id, Model3dType.MESH)
        assert isinstance(model, Mesh)
        return model
