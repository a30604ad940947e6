"""The kinematic calibration used for a robot, over REST (docs/protocol.md)."""

from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Timestamp, TranslatableData, Unset
from arcor2_hw.data.role import Role
from arcor2_hw.messages import Message
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import operation
from arcor2_server.workspace.robot_calibrations import ActiveKinematics, RobotCalibrations
from arcor2_server.workspace.robots import SceneRobots


class RobotKinematics(TranslatableData, frozen=True):
    """Kinematic calibration with which the server computes the kinematics of a robot, also offline.

    read, checksum: time and checksum of the calibration read from the controller. refused: reason why it is not
    used, with `key` and `values`.
    """

    object_id: str
    name: str
    in_force: ActiveKinematics
    read: Timestamp | Unset = UNSET
    checksum: str | Unset = UNSET
    refused: str | Unset = UNSET


@dataclass(frozen=True, slots=True)
class KinematicsOperations:
    """The kinematic calibration used for a robot, over REST (docs/protocol.md)."""

    _online: OnlineScene
    _robot_calibrations: RobotCalibrations
    _robots: SceneRobots

    @operation("GET", "/api/robots/{object_id}/kinematics", SERVER, Role.OPERATOR, plain=True)
    async def robot_kinematics(self, object_id: str) -> RobotKinematics:
        """Return the kinematic calibration used for a robot of the open scene."""
        robot = self._online.robot(object_id)
        if self._robots.model_of_type(robot.type) is None:
            return RobotKinematics(robot.id, robot.name, ActiveKinematics.NONE)
        stored = self._robot_calibrations.stored(robot)
        if stored is None:
            return RobotKinematics(robot.id, robot.name, ActiveKinematics.NOMINAL)
        found = RobotKinematics(
            robot.id, robot.name, ActiveKinematics.MEASURED, stored.read, stored.calibration.checksum
        )
        if not stored.refused:
            return found
        why = stored.refused if isinstance(stored.refused, Message) else Message.of(stored.refused)
        return replace(found, in_force=ActiveKinematics.NOMINAL, refused=why.text, **why.translation())
