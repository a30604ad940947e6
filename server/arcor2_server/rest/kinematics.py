"""The kinematic calibration of a robot that is in use, over REST (docs/protocol.md)."""

from dataclasses import dataclass

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.role import Role
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import operation
from arcor2_server.workspace.robot_calibrations import InForce, RobotCalibrations
from arcor2_server.workspace.robots import SceneRobots


class RobotKinematics(Data, frozen=True):
    """What a robot's kinematics are computed with here, offline too. read, checksum: of what its controller told.

    refused: why that is not used.
    """

    object_id: str
    name: str
    in_force: InForce
    read: Timestamp | Unset = UNSET
    checksum: str | Unset = UNSET
    refused: str | Unset = UNSET


@dataclass(frozen=True, slots=True)
class KinematicsOperations:
    """Which kinematics of a robot are in force, over REST (docs/protocol.md)."""

    _online: OnlineScene
    _robot_calibrations: RobotCalibrations
    _robots: SceneRobots

    @operation("GET", "/api/robots/{object_id}/kinematics", SERVER, Role.OPERATOR, plain=True)
    async def robot_kinematics(self, object_id: str) -> RobotKinematics:
        """Tell with which kinematics those of a robot of the open scene are computed, and since when."""
        robot = self._online.robot(object_id)
        if self._robots.model_of_type(robot.type) is None:
            return RobotKinematics(robot.id, robot.name, InForce.NONE)
        kept = self._robot_calibrations.stored(robot)
        if kept is None:
            return RobotKinematics(robot.id, robot.name, InForce.NOMINAL)
        state = InForce.NOMINAL if kept.refused else InForce.MEASURED
        checksum, refused = kept.calibration.checksum, kept.refused or UNSET
        return RobotKinematics(robot.id, robot.name, state, kept.read, checksum, refused)
