"""Determines the motions of an action from the names and types of its parameters.

Object types declare no motions. The convention that the drivers share is documented in docs/how-to/add-a-robot.md, and
docs/decisions/0023-dry-run.md explains it.
"""

from collections.abc import Mapping
from typing import Any, Final

import msgspec

from arcor2_hw.compute.dry_run_tasks import ActionMoves, Move
from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.project import Action, ActionParameterType
from arcor2_hw.data.project_index import ProjectIndex, global_pose
from arcor2_hw.data.robot import RobotMaxima

ACCELERATION: Final = 0.5
"""Fraction of the maximum acceleration for actions without the parameter."""
SPEED: Final = 0.5
"""Fraction of the maximum speed for actions without the parameter."""
LINES: Final = ("linear", "line")
"""Values of `move_type` for a straight line."""


class UnknownTarget(Exception):
    """The target of a motion is known only in a run."""


def maxima_of(settings: Mapping[str, Any]) -> RobotMaxima:
    """Return the maximum velocities and accelerations in the settings of a robot."""

    def stated(name: str) -> float:
        value = settings.get(name)
        return float(value) if isinstance(value, int | float) and value > 0.0 else 0.0

    names = ("max_joint_speed", "joint_acceleration", "max_tcp_speed", "tcp_acceleration")
    return RobotMaxima(*map(stated, names))


def moves_of(
    action: Action, declared: ObjectAction, method: str, index: ProjectIndex, settings: Mapping[str, Any]
) -> ActionMoves | None:
    """Return the motions of an action of a robot, None if it has no target.

    Args:
        action: the action.
        declared: its declaration by the object type.
        method: object type and method.
        index: the project.
        settings: the settings of the robot, with defaults.

    Raises:
        UnknownTarget: the target is the result of another action, or a parameter of a function.
        Arcor2Error: a parameter refers to something that does not exist.
    """
    values = _values(action, declared, index)
    kinds = {each.name: each.type for each in declared.parameters}
    poses = [name for name, kind in kinds.items() if kind == "pose"]
    joints = [name for name, kind in kinds.items() if kind == "joints"]
    if len(poses) + len(joints) == 0 or len(joints) > 1 or (poses and joints):
        return None
    if any(values.get(name) is None for name in (*poses, *joints)):
        raise UnknownTarget
    speed, acceleration = _number(values, "speed", SPEED), _number(values, "acceleration", ACCELERATION)
    safe = values.get("safe") is True
    arm = values.get("arm")
    end_effector = arm if isinstance(arm, str) else ""
    if joints:
        _, stored = index.joints(values[joints[0]])
        return ActionMoves([Move(None, stored.joints, False, speed, acceleration, safe)], method, end_effector)
    targets = [_pose(values[name], index) for name in poses]
    if "approach" in values and len(targets) == 1:
        slow, above = _number(values, "slow_speed", speed), _behind(targets[0], _number(values, "approach", 0.0))
        return ActionMoves(
            [
                Move(above, speed=speed, acceleration=acceleration, safe=safe),
                Move(targets[0], linear=True, speed=slow, acceleration=acceleration, dwell=_dwell(settings)),
                Move(above, linear=True, speed=slow, acceleration=acceleration),
            ],
            method,
            end_effector,
        )
    linear = values.get("move_type") in LINES or values.get("linear") is True
    return ActionMoves([Move(pose, [], linear, speed, acceleration, safe) for pose in targets], method, end_effector)


def _dwell(settings: Mapping[str, Any]) -> float:
    """Return the time that a gripper takes, s; 0 if a sensor ends the wait."""
    if isinstance(sensor := settings.get("part_sensor_input"), int) and sensor >= 0:
        return 0.0
    return next((float(settings[name]) for name in ("suction_time", "gripper_time") if name in settings), 0.0)


def _behind(pose: Pose, distance: float) -> Pose:
    """Return the pose `distance` m before another along the axis of the tool."""
    return pose * Pose(Position(0.0, 0.0, -distance))


def _pose(orientation_id: str, index: ProjectIndex) -> Pose:
    point, named = index.orientation(orientation_id)
    return global_pose(index, point, named.orientation)


def _number(values: Mapping[str, Any], name: str, default: float) -> float:
    value = values.get(name)
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) and value > 0.0 else default


def _values(action: Action, declared: ObjectAction, index: ProjectIndex) -> dict[str, Any]:
    """Return the values of parameters by name; None for those that are known only in a run."""
    found: dict[str, Any] = {
        each.name: msgspec.json.decode(each.default_value)
        for each in declared.parameters
        if not isinstance(each.default_value, Unset)
    }
    for parameter in action.parameters:
        name, value = declared.present_name(parameter.name), msgspec.json.decode(parameter.value)
        if parameter.type in (ActionParameterType.LINK, ActionParameterType.FUNCTION_PARAMETER):
            value = None
        elif parameter.type == ActionParameterType.PROJECT_PARAMETER:
            value = msgspec.json.decode(index.parameter(value).value)
        found[name] = value
    return found
