"""Robots as the calibration worker sees them: their models in the joint state in which they are looked at."""

from dataclasses import replace

from arcor2_hw.calibration.results import RobotPose
from arcor2_hw.compute.calibration_tasks import FindRobotPose
from arcor2_hw.compute.desk import Desk
from arcor2_hw.exceptions import InvalidData


def robot_pose(task: FindRobotPose, desk: Desk) -> RobotPose:
    """Give where a robot's base stands in the world."""
    import numpy as np

    from arcor2_hw.calibration.depth import read_depth
    from arcor2_hw.calibration.robot_pose import RobotPoseOptions, find_robot_pose
    from arcor2_hw.calibration.surface import surface_of

    if not task.depth:
        raise InvalidData("A depth picture is needed.")
    desk.progress(0.0, "reading the depth pictures")
    depth = [read_depth(picture) for picture in task.depth]
    if len({picture.shape for picture in depth}) > 1:
        raise InvalidData("The depth pictures are of different sizes.")
    desk.progress(0.1, "reading the robot's model")
    surface = surface_of(desk.robot(task.robot), task.joints)
    if task.robot.called:
        surface = replace(surface, name=task.robot.called)
    desk.progress(0.3, "looking for the robot")
    options = RobotPoseOptions(within=task.distance, angle_within=task.angle)
    return find_robot_pose(surface, np.stack(depth), task.parameters, task.camera_pose, task.robot.base, options)
