"""Kinematics of robots that compute none themselves, or are not there: by the compute worker, from their models."""

from typing import TYPE_CHECKING

from arcor2_hw.collision.description import WorldRobot
from arcor2_hw.compute.kinematics_tasks import SolveForward, SolveInverse
from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.rpc import ForwardKinematicsArgs, InverseKinematicsArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, KinematicsError
from arcor2_server.workspace.robot_models import model_of
from arcor2_server.workspace.scene_collisions import in_names, present_joints, robots, things

if TYPE_CHECKING:
    from arcor2_server.services import Services


def solves(services: "Services", robot: SceneObject, feature: str) -> bool:
    """Tell whether the device itself answers: it is in operation, and its type has the feature."""
    return services.cell.online and getattr(services.types.robot_meta(robot.type).features, feature)


async def inverse(services: "Services", robot: SceneObject, args: InverseKinematicsArgs) -> list[Joint]:
    """Give joints that reach a pose. RequestRefused for a robot without a model, KinematicsError when there are none.

    With `avoid_collisions`: of the scene's bodies, other robots as they stand now, and the robot itself.
    """
    model = model_of(services, robot, "from which joints could be computed")
    start = None if isinstance(args.start_joints, Unset) else args.start_joints
    if start is None:
        start = await present_joints(services, robot) or None
    effector = _end_effector(args.end_effector_id, args.arm_id)
    task = SolveInverse(robot.id, effector, args.pose, start, args.avoid_collisions)
    if not args.avoid_collisions:
        return await services.compute.run(task, world={robot.id: WorldRobot(robot.id, model)})
    others = [one for one in robots(services) if one.id != robot.id]
    joints = {one.id: await present_joints(services, one) for one in others}
    # Others whose joints are not known are not known to stand anywhere.
    known = [one for one in others if joints[one.id]]
    try:
        return await services.compute.run(task, world=things(services, [robot, *known], joints))
    except KinematicsError as error:
        Arcor2Error.__init__(error, in_names(services, str(error)), error.detail)  # with its code and reason
        raise


async def forward(services: "Services", robot: SceneObject, args: ForwardKinematicsArgs) -> Pose:
    """Give the pose that joints lead to. RequestRefused for a robot without a model, InvalidData for wrong joints."""
    model = model_of(services, robot, "from which a pose could be computed")
    task = SolveForward(model, _end_effector(args.end_effector_id, args.arm_id), args.joints)
    return await services.compute.run(task)


def _end_effector(name: str, arm_id: str | Unset) -> str:
    """Give the link of an end effector; in the model of a robot with several arms it carries the arm's name."""
    return name if isinstance(arm_id, Unset) else f"{arm_id}_{name}"
