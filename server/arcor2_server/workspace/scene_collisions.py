"""The collision world of the open scene for the compute worker (bodies, robots, gripped parts), and line checks."""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from arcor2_hw.collision.description import (
    Attachment,
    MeshShape,
    Obstacle,
    Shape,
    StoredFile,
    WorldBody,
    WorldItem,
    WorldRobot,
)
from arcor2_hw.collision.lines import Hit, first_hit
from arcor2_hw.compute.kinematics_tasks import CheckLines, Line, PlaceInLink
from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Mesh, Models
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import SceneObject, zones_of
from arcor2_hw.exceptions import Conflict
from arcor2_hw.kinematics.primitives import primitive_of
from arcor2_hw.messages import Message
from arcor2_hw.runtime.messages import HeldPart
from arcor2_server.compute.workers import Compute
from arcor2_server.documents import Session
from arcor2_server.hosts.session import HostSession, decoded_info
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.storage import AssetStore
from arcor2_server.workspace.obstacles import ObstacleRegistry
from arcor2_server.workspace.robot_models import RobotModels
from arcor2_server.workspace.robots import SceneRobots

Joints = Mapping[str, list[Joint]]
"""Present joint values by robot."""


def _gripped(obstacle: Obstacle, robot: str, part: HeldPart) -> Obstacle:
    return Obstacle.of(obstacle.model, part.pose, obstacle.scale, Attachment(robot, part.link))


@functools.lru_cache(maxsize=1)
def _of_program(encoded: bytes) -> tuple[tuple[str, str, Obstacle], ...]:
    info = decoded_info(encoded)
    kinds = info.collision_models
    every: list[Models] = [*kinds.boxes, *kinds.spheres, *kinds.cylinders, *kinds.meshes]
    models = {one.id: one for one in every}
    zones = zones_of(info.scene)
    return tuple(
        (obstacle.id, obstacle.name, Obstacle.of(models[obstacle.type], obstacle.pose))
        for obstacle in info.scene.objects
        if obstacle.type in models and obstacle.id not in zones and not isinstance(obstacle.pose, Unset)
    )


@dataclass(frozen=True, slots=True)
class SceneCollisions:
    """The collision world of the open scene, as the compute worker needs it."""

    _assets: AssetStore
    _types: ObjectTypes
    _session: Session
    _compute: Compute
    _collisions: ObstacleRegistry
    _robots: SceneRobots
    _robot_models: RobotModels
    _scene_host: HostSession
    _program_host: HostSession

    # ------------------------------------------------------------------------------------------------ bodies
    def mesh_file(self, asset_id: str) -> StoredFile:
        """Return the file of a mesh. A missing asset has an invalid path, so that the worker reports its name."""
        path = str(self._assets.file(asset_id)) if self._assets.exists(asset_id) else "/nonexistent"
        return StoredFile(path, asset_id)

    def body_of(self, key: str, obstacle: Obstacle) -> WorldBody:
        """Return an obstacle as a body of a world description."""
        model = obstacle.model
        shape: Shape = (
            MeshShape(self.mesh_file(model.asset_id), obstacle.scale)
            if isinstance(model, Mesh)
            else primitive_of(model)
        )
        return WorldBody(key, shape, obstacle.pose, obstacle.attachment)

    def online_obstacles(self) -> dict[str, Obstacle]:
        """Return all collision models by id: those added over REST, and those of the online scene or running program.

        A gripped part is in the frame of the link that holds it.
        """
        return dict(self._of_online_scene()) | self._collisions.obstacles

    def _of_online_scene(self) -> Iterator[tuple[str, Obstacle]]:
        if self._session.scene is not None and self._scene_host.online:
            board, obstacles = self._scene_host.board, self._of_open_scene()
        elif (encoded := self._program_host.package_info) is not None:
            board, obstacles = self._program_host.board, list(_of_program(encoded))
        else:
            return
        disabled, held = board.disabled_obstacles(), board.held_parts()
        for key, name, one in obstacles:
            if key not in disabled:
                yield key, _gripped(one, *held[name]) if name in held else one
        for name, (robot, part) in held.items():
            if part.model is not None:
                yield name, _gripped(Obstacle.of(part.model.model(), part.pose), robot, part)

    def obstacles(self) -> dict[str, Obstacle]:
        """Return the collision models of the open scene, online or not, and those added over REST."""
        found = self.online_obstacles()
        if not self._scene_host.online:
            for key, _, obstacle in self._of_open_scene():
                found.setdefault(key, obstacle)
        return found

    def _of_open_scene(self) -> list[tuple[str, str, Obstacle]]:
        """Return id, name and collision model of the objects of the open scene."""
        scene = self._session.scene
        zones = zones_of(scene)
        return [
            (obj.id, obj.name, Obstacle.of(model.model(), obj.pose))
            for obj in (() if scene is None else scene.objects)
            if obj.id not in zones
            and not isinstance(model := self._types.meta(obj.type).object_model, Unset)
            and not isinstance(obj.pose, Unset)
        ]

    def world(self, chosen: list[SceneObject], joints: Joints | None = None) -> dict[str, WorldItem]:
        """Return the world description of the open scene with the chosen robots and the parts that they hold.

        Parts held by other robots are left out.

        Args:
            chosen: The robots.
            joints: Joint values by robot. A robot without them is in its middle position.
        """
        present = joints or {}
        found: dict[str, WorldItem] = {}
        for robot in chosen:
            model = self._robot_models.find(robot)
            if model is not None:
                found[robot.id] = WorldRobot(robot.id, model, present.get(robot.id, []))
        for key, obstacle in self.obstacles().items():
            if key not in found and (obstacle.attachment is None or obstacle.attachment.robot in found):
                found[key] = self.body_of(key, obstacle)
        return found

    def with_names(self, text: str) -> str:
        """Replace the ids of objects in a message of the worker by their names."""
        scene = self._session.scene
        if not text or scene is None:
            return text
        # Longest first, since an id may be the prefix of another.
        for obj in sorted(scene.objects, key=lambda obj: len(obj.id), reverse=True):
            text = text.replace(obj.id, obj.name)
        return text

    def named(self, message: Message) -> Message:
        """Replace the ids of objects in a message of the worker and in its values by their names."""
        values = {
            name: self.with_names(value) if isinstance(value, str) else self.named(value)
            for name, value in message.values.items()
        }
        return Message(self.with_names(message.text), message.key, values)

    # ------------------------------------------------------------------------------------------------ lines
    async def hit(self, start: Position, end: Position) -> Hit | None:
        """Return the first body of the online scene that a straight line hits, None if the line is free.

        As in the protocol, robots are ignored, since the line is the path of one, but the parts that they hold are not.
        """
        obstacles = self.online_obstacles()
        inflation = self._collisions.inflation
        found = first_hit(start, end, obstacles.items(), inflation)
        rest = {key: one for key, one in obstacles.items() if not one.is_fixed_primitive}
        if not rest:
            return found
        holders = {one.attachment.robot for one in rest.values() if one.attachment is not None}
        chosen = [robot for robot in self._robots.with_models() if robot.id in holders]
        joints = {robot.id: await self._robots.present_joints(robot) for robot in chosen}
        world: dict[str, WorldItem] = {
            key: thing for key, thing in self.world(chosen, joints).items() if key in rest or key in holders
        }
        task = CheckLines([Line(start, end)], inflation, sorted(holders))
        (further,) = await self._compute.run(task, world=world)
        if further is not None and (found is None or further.share < found.share):
            return Hit(further.id, further.share)
        return found

    # ------------------------------------------------------------------------------------------------ holding
    async def attach(self, key: str, robot: SceneObject, link: str) -> None:
        """Attach an obstacle to a link of a robot at their present poses.

        Raises:
            NotFound: The obstacle or link does not exist.
            Conflict: It is attached already, or the robot has no model or unknown joints.
        """
        obstacle = self._collisions.get(key)
        if obstacle.attachment is not None:
            raise Conflict("{key} is held already.", key=key)
        in_link = await self._in_link(robot, link, obstacle.pose)
        self._collisions.put(Obstacle.of(obstacle.model, in_link, obstacle.scale, Attachment(robot.id, link)))

    async def detach(self, key: str) -> Pose:
        """Detach an obstacle and return its pose, which stays as it is.

        Raises:
            NotFound: The obstacle does not exist.
            Conflict: It is not attached, or the joints of the robot are unknown.
        """
        obstacle = self._collisions.get(key)
        if obstacle.attachment is None:
            raise Conflict("{key} is not held.", key=key)
        robot = self._robots.robot(obstacle.attachment.robot)
        link_from_world = await self._in_link(robot, obstacle.attachment.link, Pose())
        pose = link_from_world.inverted() * obstacle.pose
        self._collisions.put(Obstacle.of(obstacle.model, pose, obstacle.scale))
        return pose

    async def _in_link(self, robot: SceneObject, link: str, pose: Pose) -> Pose:
        model = self._robot_models.find(robot)
        if model is None:
            raise Conflict("{name} has no model (URDF) that could hold anything.", name=robot.name)
        joints = await self._robots.present_joints(robot)
        if not joints:
            raise Conflict("The joints of {name} are not known: start the scene first.", name=robot.name)
        return await self._compute.run(PlaceInLink(model, joints, link, pose))
