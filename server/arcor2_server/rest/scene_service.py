"""The Scene service: collision models, line checks, poses from focus points (protocol, section 14)."""

from dataclasses import dataclass

from arcor2_hw.collision.description import Obstacle
from arcor2_hw.compute.kinematics_tasks import ReadMesh
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box, Cylinder, Mesh, Models, Sphere
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData
from arcor2_server.compute.workers import Compute
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rest.operations import operation
from arcor2_server.rest.scenes import check_id
from arcor2_server.storage import AssetStore
from arcor2_server.workspace import point_registration
from arcor2_server.workspace.obstacles import ObstacleRegistry
from arcor2_server.workspace.scene_collisions import SceneCollisions

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
    """A cylinder along its z axis; m."""

    cylinder_id: str
    radius: float
    height: float


class MeshQuery(Data, frozen=True, rename="camel"):
    """A mesh asset and its scale along each axis."""

    mesh_id: str
    mesh_file_id: str
    mesh_scale_x: float = 1.0
    mesh_scale_y: float = 1.0
    mesh_scale_z: float = 1.0


class MeshFocusAction(Data, frozen=True):
    """Points on a mesh in its own frame, and the positions where a robot touched them, in the same order; m."""

    mesh_focus_points: list[Position]
    robot_space_points: list[Position]


class LineCheck(Data, frozen=True):
    """A straight line between two points of the world, m."""

    pt1: Position
    pt2: Position


class LineCheckResult(Data, frozen=True):
    """Whether the line is free, and if not, the first object that it hits."""

    safe: bool
    object_id: str | Unset = UNSET


class HolderQuery(Data, frozen=True, rename="camel"):
    """A robot of the online scene, and the link of its model to which an object is attached."""

    robot_id: str
    link: str


@dataclass(frozen=True, slots=True)
class SceneServiceOperations:
    """The Scene service: collision models, line checks, poses from focus points (protocol, section 14)."""

    _assets: AssetStore
    _online: OnlineScene
    _compute: Compute
    _collisions: ObstacleRegistry
    _scene_collisions: SceneCollisions

    def _put(self, kind: type[Models], pose: Pose, key: str, *sizes: float | str) -> str:
        check_id(key, "collision model")
        try:
            model = kind(key, *sizes)  # type: ignore[arg-type]
        except ValueError as error:
            raise InvalidData("{reason}.", reason=error) from None
        self._collisions.put(Obstacle.of(model, pose))
        return "ok"

    @operation("PUT", "/collisions/box", SCENE, Role.TECHNICIAN)
    async def put_box(self, query: BoxQuery, body: Pose) -> str:
        """Add a box to the collision models."""
        return self._put(Box, body, query.box_id, query.size_x, query.size_y, query.size_z)

    @operation("PUT", "/collisions/sphere", SCENE, Role.TECHNICIAN)
    async def put_sphere(self, query: SphereQuery, body: Pose) -> str:
        """Add a sphere to the collision models."""
        return self._put(Sphere, body, query.sphere_id, query.radius)

    @operation("PUT", "/collisions/cylinder", SCENE, Role.TECHNICIAN)
    async def put_cylinder(self, query: CylinderQuery, body: Pose) -> str:
        """Add a cylinder to the collision models."""
        return self._put(Cylinder, body, query.cylinder_id, query.radius, query.height)

    @operation("PUT", "/collisions/mesh", SCENE, Role.TECHNICIAN)
    async def put_mesh(self, query: MeshQuery, body: Pose) -> str:
        """Add a mesh asset to the collision models, scaled along each axis."""
        check_id(query.mesh_id, "collision model")
        scale = (query.mesh_scale_x, query.mesh_scale_y, query.mesh_scale_z)
        if 0.0 in scale:
            raise InvalidData("The scale of a mesh must not be 0.")
        self._assets.info(query.mesh_file_id)
        await self._compute.run(ReadMesh(self._scene_collisions.mesh_file(query.mesh_file_id), scale))
        self._collisions.put(Obstacle.of(Mesh(query.mesh_id, query.mesh_file_id), body, scale))
        return "ok"

    @operation("GET", "/collisions", SCENE, Role.OPERATOR)
    async def list_collisions(self) -> list[str]:
        """Return the ids of all collision models: added ones, and the objects of the online scene."""
        return sorted(self._scene_collisions.online_obstacles())

    @operation("DELETE", "/collisions/{id}", SCENE, Role.TECHNICIAN)
    async def delete_collision(self, id: str) -> None:  # noqa: A002 - name in the protocol
        """Remove an added collision model."""
        self._collisions.remove(id)

    @operation("PUT", "/system/start", SCENE, Role.TECHNICIAN)
    async def start_system(self) -> None:
        """Mark the scene as started. No device is connected; use StartScene of the websocket for that."""
        self._collisions.start()

    @operation("PUT", "/system/stop", SCENE, Role.TECHNICIAN)
    async def stop_system(self) -> None:
        """Mark the scene as stopped, and remove all added collision models."""
        self._collisions.stop()

    @operation("GET", "/system/running", SCENE, Role.OPERATOR)
    async def system_running(self) -> bool:
        """Return whether the scene is marked as started or is online."""
        return self._collisions.started or self._online.online

    @operation("PUT", "/utils/focus", SCENE, Role.OPERATOR)
    async def find_by_focus(self, body: MeshFocusAction) -> Pose:
        """Return the pose of an object from at least three touched points, by least squares."""
        return point_registration.fit(body.mesh_focus_points, body.robot_space_points).pose

    @operation("PUT", "/utils/line-safe", SCENE, Role.OPERATOR, plain=True)
    async def check_line(self, body: LineCheck) -> LineCheckResult:
        """Return whether a straight line is free of the collision models, which are slightly inflated."""
        found = await self._scene_collisions.hit(body.pt1, body.pt2)
        return LineCheckResult(True) if found is None else LineCheckResult(False, found.id)

    @operation("PUT", "/collisions/{id}/attach", SCENE, Role.TECHNICIAN)
    async def attach_collision(self, id: str, query: HolderQuery) -> None:  # noqa: A002 - as above
        """Attach an added collision model to a link of a robot, at its present pose."""
        self._online.require_online()
        await self._scene_collisions.attach(id, self._online.robot(query.robot_id), query.link)

    @operation("PUT", "/collisions/{id}/detach", SCENE, Role.TECHNICIAN)
    async def detach_collision(self, id: str) -> Pose:  # noqa: A002 - as above
        """Detach a collision model from a robot; return its pose, which is unchanged."""
        self._online.require_online()
        return await self._scene_collisions.detach(id)
