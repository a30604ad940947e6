"""Kinematics from robot models, for robots that are offline or do not compute it themselves."""

from dataclasses import dataclass

from arcor2_hw.collision.description import WorldRobot
from arcor2_hw.compute.kinematics_tasks import SolveForward, SolveInverse
from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.rpc import ForwardKinematicsArgs, InverseKinematicsArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import KinematicsError
from arcor2_server.compute.workers import Compute
from arcor2_server.hosts.session import HostSession
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.workspace.robot_models import RobotModels
from arcor2_server.workspace.robots import SceneRobots, end_effector_link
from arcor2_server.workspace.scene_collisions import SceneCollisions


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Forward and inverse kinematics from the models of robots, computed by the compute worker."""

    _types: ObjectTypes
    _host: HostSession
    _compute: Compute
    _robots: SceneRobots
    _robot_models: RobotModels
    _scene_collisions: SceneCollisions

    def solves(self, robot: SceneObject, feature: str) -> bool:
        """Return whether the robot itself computes kinematics: it is online, and its type has the feature."""
        return self._host.online and getattr(self._types.robot_meta(robot.type).features, feature)

    async def inverse(self, robot: SceneObject, args: InverseKinematicsArgs) -> list[Joint]:
        """Return joints that reach a pose.

        With `avoid_collisions`, they avoid the bodies of the scene, other robots at their present joints, and
        collisions of the robot with itself.

        Raises:
            RequestRefused: The robot has no model.
            KinematicsError: No such joints exist.
        """
        model = self._robot_models.require(robot, "to compute inverse kinematics")
        start = None if isinstance(args.start_joints, Unset) else args.start_joints
        if start is None:
            start = await self._robots.present_joints(robot) or None
        effector = end_effector_link(args.end_effector_id, args.arm_id)
        task = SolveInverse(robot.id, effector, args.pose, start, args.avoid_collisions)
        if not args.avoid_collisions:
            return await self._compute.run(task, world={robot.id: WorldRobot(robot.id, model)})
        others = [one for one in self._robots.with_models() if one.id != robot.id]
        joints = {one.id: await self._robots.present_joints(one) for one in others}
        # Robots with unknown joints are not obstacles.
        known = [one for one in others if joints[one.id]]
        try:
            return await self._compute.run(task, world=self._scene_collisions.world([robot, *known], joints))
        except KinematicsError as error:
            raise error.with_message(self._scene_collisions.named(error.message)) from error

    async def forward(self, robot: SceneObject, args: ForwardKinematicsArgs) -> Pose:
        """Return the pose for joints. Raise RequestRefused without a model, InvalidData for wrong joints."""
        model = self._robot_models.require(robot, "to compute forward kinematics")
        task = SolveForward(model, end_effector_link(args.end_effector_id, args.arm_id), args.joints)
        return await self._compute.run(task)
