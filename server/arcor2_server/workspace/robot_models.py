"""Kinematic models of the robots of the open scene, with the calibrations read from their controllers."""

from arcor2_hw.collision.description import RobotSource
from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.scene import SceneObject
from arcor2_server.errors import RequestRefused
from arcor2_server.workspace.robot_calibrations import RobotCalibrations
from arcor2_server.workspace.robots import SceneRobots


class RobotModels:
    """Robot models for the compute worker."""

    def __init__(self, robots: SceneRobots, robot_calibrations: RobotCalibrations) -> None:
        self._robots = robots
        self._robot_calibrations = robot_calibrations

    def find(self, robot: SceneObject, name: str = "") -> RobotSource | None:
        """Return the model of a robot at its pose, with its settings; None if it has no model."""
        file = self._robots.model_of_type(robot.type)
        if file is None:
            return None
        base = Pose() if isinstance(robot.pose, Unset) else robot.pose
        calibration = self._robot_calibrations.in_force(robot)
        return RobotSource(file, base, self._robots.settings_of(robot), name, calibration)

    def require(self, robot: SceneObject, purpose: str) -> RobotSource:
        """Return the model of a robot. Raise RequestRefused with the purpose if it has none."""
        model = self.find(robot, robot.name)
        if model is None:
            raise RequestRefused("{name} has no model (URDF) {purpose}.", name=robot.name, purpose=purpose)
        return model
