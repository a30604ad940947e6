"""Robots as the calibration worker sees them: their models in the joint state in which they are looked at."""

from typing import TYPE_CHECKING

from arcor2_hw.calibration.results import RobotPose
from arcor2_hw.compute.calibration_tasks import FindRobotPose
from arcor2_hw.compute.desk import Desk
from arcor2_hw.exceptions import InvalidData

if TYPE_CHECKING:
    from collections.abc import Sequence

    from arcor2_hw.calibration.surface import RobotSurface
    from arcor2_hw.data.robot import Joint
    from arcor2_hw.kinematics.model import RobotModel


def robot_pose(task: FindRobotPose, desk: Desk) -> RobotPose:
    """Give where a robot's base stands in the world."""
    import numpy as np

    from arcor2_hw.calibration.depth import read_depth
    from arcor2_hw.calibration.robot_pose import RobotPoseOptions, find_robot_pose

    if not task.depth:
        raise InvalidData("A depth picture is needed.")
    desk.progress(0.0, "reading the depth pictures")
    depth = [read_depth(picture) for picture in task.depth]
    if len({picture.shape for picture in depth}) > 1:
        raise InvalidData("The depth pictures are of different sizes.")
    desk.progress(0.1, "reading the robot's model")
    surface = surface_of(desk.robot(task.robot), task.joints)
    desk.progress(0.3, "looking for the robot")
    options = RobotPoseOptions(within=task.distance, angle_within=task.angle)
    return find_robot_pose(surface, np.stack(depth), task.parameters, task.camera_pose, task.robot.base, options)


def surface_of(model: "RobotModel", joints: "Sequence[Joint]") -> "RobotSurface":
    """Give all that can be seen of a robot, in its root link's frame. ModelError for joints that are missing."""
    from arcor2_hw.calibration.surface import RobotSurface
    from arcor2_hw.kinematics.shapes import triangles_of

    poses = model.link_poses(model.values(joints))
    parts = []
    for part in model.visual or model.collision:
        mesh = triangles_of(part.shape)
        parts.append((mesh.vertices, mesh.triangles, poses[part.link] @ part.origin))
    return RobotSurface.of_links(parts, model.name)
