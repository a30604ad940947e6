"""Kinematics of robots that are offline or compute none themselves, from their models."""

from arcor2_hw.collision.description import WorldRobot
from arcor2_hw.compute.kinematics_tasks import SolveForward, SolveInverse
from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.rpc import ForwardKinematicsArgs, InverseKinematicsArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, KinematicsError
from arcor2_server.compute.workers import Compute
from arcor2_server.hosts.session import HostSession
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.workspace.robot_models import RobotModels
from arcor2_server.workspace.robots import SceneRobots
from arcor2_server.workspace.scene_collisions import SceneCollisions


def _end_effector(name: str, arm_id: str | Unset) -> str:
    """Return the link of an end effector; in the model of a robot with several arms it carries the arm's name."""
    return name if isinstance(arm_id, Unset) else f"{arm_id}_{name}"


class Kinematics:
    """Forward and inverse kinematics from the models of robots, computed by the worker."""

    def __init__(
        self,
        types: ObjectTypes,
        host: HostSession,
        compute: Compute,
        robots: SceneRobots,
        robot_models: RobotModels,
        scene_collisions: SceneCollisions,
    ) -> None:
        self._types = types
        self._host = host
        self._compute = compute
        self._robots = robots
        self._robot_models = robot_models
        self._scene_collisions = scene_collisions

    def solves(self, robot: SceneObject, feature: str) -> bool:
        """Return whether the device itself answers: it is in operation, and its type has the feature."""
        return self._host.online and getattr(self._types.robot_meta(robot.type).features, feature)

    async def inverse(self, robot: SceneObject, args: InverseKinematicsArgs) -> list[Joint]:
        """Return joints that reach a pose. RequestRefused for a robot without a model, KinematicsError if none exist.

        `avoid_collisions`: with the bodies of the scene, other robots at their present joints, and the robot itself.
        """
        model = self._robot_models.require(robot, "from which joints could be computed")
        start = None if isinstance(args.start_joints, Unset) else args.start_joints
        if start is None:
            start = await self._robots.present_joints(robot) or None
        effector = _end_effector(args.end_effector_id, args.arm_id)
        task = SolveInverse(robot.id, effector, args.pose, start, args.avoid_collisions)
        if not args.avoid_collisions:
            return await self._compute.run(task, world={robot.id: WorldRobot(robot.id, model)})
        others = [one for one in self._robots.with_models() if one.id != robot.id]
        joints = {one.id: await self._robots.present_joints(one) for one in others}
        # Others whose joints are not known are not known to stand anywhere.
        known = [one for one in others if joints[one.id]]
        try:
            return await self._compute.run(task, world=self._scene_collisions.world([robot, *known], joints))
        except KinematicsError as error:
            Arcor2Error.__init__(
                error, self._scene_collisions.with_names(str(error)), error.detail
            )  # with its code and reason
            raise

    async def forward(self, robot: SceneObject, args: ForwardKinematicsArgs) -> Pose:
        """Return the pose for joints. RequestRefused for a robot without a model, InvalidData for wrong joints."""
        model = self._robot_models.require(robot, "from which a pose could be computed")
        task = SolveForward(model, _end_effector(args.end_effector_id, args.arm_id), args.joints)
        return await self._compute.run(task)
