"""The Scene service: collision models, lines through them, where an object stands (protocol, section 14)."""

from arcor2_hw.compute.kinematics_tasks import ReadMesh
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box, Cylinder, Mesh, Models, Sphere
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData
from arcor2_server.rest.operations import operation
from arcor2_server.rest.scenes import check_id
from arcor2_server.services import Services
from arcor2_server.workspace import point_registration
from arcor2_server.workspace.collisions import Placed
from arcor2_server.workspace.scene_collisions import attach, detach, hit, kept_mesh

SCENE = "Scene"


class BoxQuery(Data, frozen=True, rename="camel"):
    """A box; edges in m."""

    box_id: str
    size_x: float
    size_y: float
    size_z: float


class SphereQuery(Data, frozen=True, rename="camel"):
    """A sphere; m."""

    sphere_id: str
    radius: float


class CylinderQuery(Data, frozen=True, rename="camel"):
    """A cylinder along its z; m."""

    cylinder_id: str
    radius: float
    height: float


class MeshQuery(Data, frozen=True, rename="camel"):
    """A mesh that is kept as an asset."""

    mesh_id: str
    mesh_file_id: str
    mesh_scale_x: float = 1.0
    mesh_scale_y: float = 1.0
    mesh_scale_z: float = 1.0


class MeshFocusAction(Data, frozen=True):
    """Points on a mesh, in its own frame, and where a robot touched them, in the same order; m."""

    mesh_focus_points: list[Position]
    robot_space_points: list[Position]


class LineCheck(Data, frozen=True):
    """A straight line between two points of the world, m."""

    pt1: Position
    pt2: Position


class LineCheckResult(Data, frozen=True):
    """Whether the line is free, and if not, what it meets first."""

    safe: bool
    object_id: str | Unset = UNSET


class HolderQuery(Data, frozen=True, rename="camel"):
    """A robot of the scene that is online, and the link of its model that holds."""

    robot_id: str
    link: str


def _put(services: Services, kind: type[Models], pose: Pose, key: str, *sizes: float | str) -> str:
    check_id(key, "collision model")
    try:
        model = kind(key, *sizes)  # type: ignore[arg-type]
    except ValueError as error:
        raise InvalidData(f"{error}.") from None
    services.collisions.put(Placed(model, pose))
    return "ok"


@operation("PUT", "/collisions/box", SCENE, Role.TECHNICIAN)
async def put_box(services: Services, query: BoxQuery, body: Pose) -> str:
    """Put a box in the way."""
    return _put(services, Box, body, query.box_id, query.size_x, query.size_y, query.size_z)


@operation("PUT", "/collisions/sphere", SCENE, Role.TECHNICIAN)
async def put_sphere(services: Services, query: SphereQuery, body: Pose) -> str:
    """Put a sphere in the way."""
    return _put(services, Sphere, body, query.sphere_id, query.radius)


@operation("PUT", "/collisions/cylinder", SCENE, Role.TECHNICIAN)
async def put_cylinder(services: Services, query: CylinderQuery, body: Pose) -> str:
    """Put a cylinder in the way."""
    return _put(services, Cylinder, body, query.cylinder_id, query.radius, query.height)


@operation("PUT", "/collisions/mesh", SCENE, Role.TECHNICIAN)
async def put_mesh(services: Services, query: MeshQuery, body: Pose) -> str:
    """Put a mesh in the way, which is an asset; each axis may be scaled."""
    check_id(query.mesh_id, "collision model")
    scale = (query.mesh_scale_x, query.mesh_scale_y, query.mesh_scale_z)
    if 0.0 in scale:
        raise InvalidData("A mesh cannot be scaled to nothing.")
    services.assets.info(query.mesh_file_id)
    await services.compute.run(ReadMesh(kept_mesh(services, query.mesh_file_id), scale))
    services.collisions.put(Placed(Mesh(query.mesh_id, query.mesh_file_id), body, scale))
    return "ok"


@operation("GET", "/collisions", SCENE, Role.OPERATOR)
async def list_collisions(services: Services) -> list[str]:
    """Give the ids of all that is in the way: what was put in, and the objects of the scene that is online."""
    return sorted(services.collisions.everything(services))


@operation("DELETE", "/collisions/{id}", SCENE, Role.TECHNICIAN)
async def delete_collision(services: Services, id: str) -> None:  # noqa: A002 - the protocol calls it so
    """Take out of the way what was put in."""
    services.collisions.remove(id)


@operation("PUT", "/system/start", SCENE, Role.TECHNICIAN)
async def start_system(services: Services) -> None:
    """Note that the scene is started; no device is touched, which the websocket's StartScene does."""
    services.collisions.started = True


@operation("PUT", "/system/stop", SCENE, Role.TECHNICIAN)
async def stop_system(services: Services) -> None:
    """Note that the scene is stopped, and take out of the way all that was put in."""
    services.collisions.stop()


@operation("GET", "/system/running", SCENE, Role.OPERATOR)
async def system_running(services: Services) -> bool:
    """Tell whether the scene is started: over REST, or because it is online."""
    return services.collisions.started or services.cell.online


@operation("PUT", "/utils/focus", SCENE, Role.OPERATOR)
async def find_by_focus(body: MeshFocusAction) -> Pose:
    """Give where an object stands of which a robot touched at least three points: by least squares."""
    return point_registration.fit(body.mesh_focus_points, body.robot_space_points).pose


@operation("PUT", "/utils/line-safe", SCENE, Role.OPERATOR, plain=True)
async def check_line(services: Services, body: LineCheck) -> LineCheckResult:
    """Tell whether a straight line is free of all that stands in the way, each a little larger than stated."""
    found = await hit(services, body.pt1, body.pt2)
    return LineCheckResult(True) if found is None else LineCheckResult(False, found.id)


@operation("PUT", "/collisions/{id}/attach", SCENE, Role.TECHNICIAN)
async def attach_collision(services: Services, id: str, query: HolderQuery) -> None:  # noqa: A002 - as above
    """Let a robot hold what was put in, from where it is now: it moves with a link of the robot's model."""
    services.cell.require_online()
    await attach(services, id, services.cell.robot(query.robot_id), query.link)


@operation("PUT", "/collisions/{id}/detach", SCENE, Role.TECHNICIAN)
async def detach_collision(services: Services, id: str) -> Pose:  # noqa: A002 - as above
    """Let go of what a robot holds; it stays where it is now, which is the answer."""
    services.cell.require_online()
    return await detach(services, id)
