"""Collision models over REST (protocol, section 13): one model per id, of whatever kind."""

from arcor2_hw.data.base import Data
from arcor2_hw.data.object_type import Box, Cylinder, Mesh, Model3dType, Models, Sphere
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.rest.operations import operation
from arcor2_server.rest.scenes import STORAGE, check_id
from arcor2_server.services import Services


class MetaModel3d(Data, frozen=True):
    """Names a stored model."""

    id: str
    type: Model3dType


@operation("GET", "/models", STORAGE, Role.OPERATOR)
async def list_models(services: Services) -> list[MetaModel3d]:
    """List the collision models."""
    return [MetaModel3d(model.id, model.type()) for model in await services.storage.models()]


@operation("GET", "/models/meshes", STORAGE, Role.OPERATOR)
async def list_meshes(services: Services) -> list[Mesh]:
    """Give those models that are meshes."""
    return [model for model in await services.storage.models() if isinstance(model, Mesh)]


async def _put(services: Services, model: Models) -> None:
    check_id(model.id, "model")
    await services.storage.put_model(model)
    await services.type_news.taken(services)


@operation("PUT", "/models/box", STORAGE, Role.TECHNICIAN)
async def put_box_model(services: Services, body: Box) -> None:
    """Save a box, in place of whatever model has its id."""
    await _put(services, body)


@operation("PUT", "/models/cylinder", STORAGE, Role.TECHNICIAN)
async def put_cylinder_model(services: Services, body: Cylinder) -> None:
    """Save a cylinder, in place of whatever model has its id."""
    await _put(services, body)


@operation("PUT", "/models/sphere", STORAGE, Role.TECHNICIAN)
async def put_sphere_model(services: Services, body: Sphere) -> None:
    """Save a sphere, in place of whatever model has its id."""
    await _put(services, body)


@operation("PUT", "/models/mesh", STORAGE, Role.TECHNICIAN)
async def put_mesh_model(services: Services, body: Mesh) -> None:
    """Save a mesh, in place of whatever model has its id."""
    await _put(services, body)


@operation("DELETE", "/models/{model_id}", STORAGE, Role.TECHNICIAN)
async def delete_model(services: Services, model_id: str) -> None:
    """Delete a collision model."""
    await services.storage.delete_model(model_id)
    await services.type_news.taken(services)


async def _of_kind(services: Services, key: str, kind: Model3dType) -> Models:
    model = await services.storage.model(key)
    if model.type() is not kind:
        raise NotFound(f"The model {key} is a {model.type().value.lower()}, not a {kind.value.lower()}.")
    return model


@operation("GET", "/models/{model_id}/{model_type}", STORAGE, Role.OPERATOR)
async def get_model(services: Services, model_id: str, model_type: str) -> Models:
    """Give a collision model of the kind that is asked for: box, cylinder, sphere or mesh."""
    try:
        kind = Model3dType(model_type.capitalize())
    except ValueError:
        raise InvalidData(f"There is no kind of model {model_type[:40]!r}.") from None
    return await _of_kind(services, model_id, kind)


@operation("GET", "/models/{model_id}/box", STORAGE, Role.OPERATOR)
async def get_box(services: Services, model_id: str) -> Box:
    """Give a box."""
    model = await _of_kind(services, model_id, Model3dType.BOX)
    assert isinstance(model, Box)
    return model


@operation("GET", "/models/{model_id}/cylinder", STORAGE, Role.OPERATOR)
async def get_cylinder(services: Services, model_id: str) -> Cylinder:
    """Give a cylinder."""
    model = await _of_kind(services, model_id, Model3dType.CYLINDER)
    assert isinstance(model, Cylinder)
    return model


@operation("GET", "/models/{model_id}/sphere", STORAGE, Role.OPERATOR)
async def get_sphere(services: Services, model_id: str) -> Sphere:
    """Give a sphere."""
    model = await _of_kind(services, model_id, Model3dType.SPHERE)
    assert isinstance(model, Sphere)
    return model


@operation("GET", "/models/{model_id}/mesh", STORAGE, Role.OPERATOR)
async def get_mesh(services: Services, model_id: str) -> Mesh:
    """Give a mesh."""
    model = await _of_kind(services, model_id, Model3dType.MESH)
    assert isinstance(model, Mesh)
    return model
