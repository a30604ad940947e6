"""Arguments about action points, orientations and joints."""

from typing import Final

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.geometry import Orientation, Position
from arcor2_hw.data.robot import Joint, RobotArg
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc
from arcor2_hw.data.rpc.general import IdArgs


class AddActionPointArgs(Data, frozen=True):
    """Arguments of AddActionPoint."""

    name: str
    position: Position
    parent: str | Unset = UNSET


class AddActionPointJointsUsingRobotArgs(Data, frozen=True):
    """Arguments of AddActionPointJointsUsingRobot."""

    action_point_id: str
    robot_id: str
    name: str = "default"
    arm_id: str | Unset = UNSET
    end_effector_id: str | Unset = UNSET


class AddActionPointOrientationArgs(Data, frozen=True):
    """Arguments of AddActionPointOrientation."""

    action_point_id: str
    orientation: Orientation
    name: str = "default"


class AddActionPointOrientationUsingRobotArgs(Data, frozen=True):
    """Arguments of AddActionPointOrientationUsingRobot."""

    action_point_id: str
    robot: RobotArg
    name: str = "default"


class AddApUsingRobotArgs(Data, frozen=True):
    """Arguments of AddApUsingRobot."""

    robot_id: str
    end_effector_id: str
    name: str
    arm_id: str | Unset = UNSET


class CopyActionPointArgs(Data, frozen=True):
    """Arguments of CopyActionPoint."""

    id: str
    position: Position | Unset = UNSET


class RemoveActionPointJointsArgs(Data, frozen=True):
    """Arguments of RemoveActionPointJoints."""

    joints_id: str


class RemoveActionPointOrientationArgs(Data, frozen=True):
    """Arguments of RemoveActionPointOrientation."""

    orientation_id: str


class RenameActionPointArgs(Data, frozen=True):
    """Arguments of RenameActionPoint."""

    action_point_id: str
    new_name: str


class RenameActionPointJointsArgs(Data, frozen=True):
    """Arguments of RenameActionPointJoints."""

    joints_id: str
    new_name: str


class RenameActionPointOrientationArgs(Data, frozen=True):
    """Arguments of RenameActionPointOrientation."""

    orientation_id: str
    new_name: str


class UpdateActionPointJointsArgs(Data, frozen=True):
    """Arguments of UpdateActionPointJoints."""

    joints_id: str
    joints: list[Joint]


class UpdateActionPointJointsUsingRobotArgs(Data, frozen=True):
    """Arguments of UpdateActionPointJointsUsingRobot."""

    joints_id: str = "default"


class UpdateActionPointOrientationArgs(Data, frozen=True):
    """Arguments of UpdateActionPointOrientation."""

    orientation_id: str
    orientation: Orientation


class UpdateActionPointOrientationUsingRobotArgs(Data, frozen=True):
    """Arguments of UpdateActionPointOrientationUsingRobot."""

    orientation_id: str
    robot: RobotArg


class UpdateActionPointParentArgs(Data, frozen=True):
    """Arguments of UpdateActionPointParent."""

    action_point_id: str
    new_parent_id: str


class UpdateActionPointPositionArgs(Data, frozen=True):
    """Arguments of UpdateActionPointPosition."""

    action_point_id: str
    new_position: Position


class UpdateActionPointUsingRobotArgs(Data, frozen=True):
    """Arguments of UpdateActionPointUsingRobot."""

    action_point_id: str
    robot: RobotArg


ACTION_POINT_RPCS: Final = (
    Rpc("AddActionPoint", AddActionPointArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("AddActionPointJointsUsingRobot", AddActionPointJointsUsingRobotArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("AddActionPointOrientation", AddActionPointOrientationArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc(
        "AddActionPointOrientationUsingRobot",
        AddActionPointOrientationUsingRobotArgs,
        None,
        Role.STANDARD_USER,
        dry_run=True,
    ),
    Rpc("AddApUsingRobot", AddApUsingRobotArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("CopyActionPoint", CopyActionPointArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("RemoveActionPoint", IdArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("RemoveActionPointJoints", RemoveActionPointJointsArgs, None, Role.STANDARD_USER),
    Rpc("RemoveActionPointOrientation", RemoveActionPointOrientationArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("RenameActionPoint", RenameActionPointArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("RenameActionPointJoints", RenameActionPointJointsArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("RenameActionPointOrientation", RenameActionPointOrientationArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("UpdateActionPointJoints", UpdateActionPointJointsArgs, None, Role.STANDARD_USER),
    Rpc("UpdateActionPointJointsUsingRobot", UpdateActionPointJointsUsingRobotArgs, None, Role.STANDARD_USER),
    Rpc("UpdateActionPointOrientation", UpdateActionPointOrientationArgs, None, Role.STANDARD_USER),
    Rpc("UpdateActionPointOrientationUsingRobot", UpdateActionPointOrientationUsingRobotArgs, None, Role.STANDARD_USER),
    Rpc("UpdateActionPointParent", UpdateActionPointParentArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("UpdateActionPointPosition", UpdateActionPointPositionArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("UpdateActionPointUsingRobot", UpdateActionPointUsingRobotArgs, None, Role.STANDARD_USER),
)
"""Requests about action points."""
