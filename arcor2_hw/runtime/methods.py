"""Kinds of methods of object types: those that only observe, that do no I/O, and the one that stops the device."""

from collections.abc import Callable
from typing import Any, Final

from arcor2_hw.objects import Axis, Generic, MultiArmRobot, Robot

STOP_RACE_TIME: Final = 0.1
"""Time after the start of a call in which its command may not have reached the device yet, s."""

NO_STOP: Final = (Robot.stop, MultiArmRobot.stop)
"""Hooks of the base classes that only raise Arcor2NotImplemented."""

OBSERVING: Final = frozenset(
    {
        *(
            "alarms",
            "connection",
            "control_owner",
            "health",
            "observations",
            "state",
            "move_in_progress",
            "robot_joints",
        ),
        *("joint_limits", "max_tcp_speed", "forward_kinematics", "get_hand_teaching_mode", "grippers", "suctions"),
        *("get_arm_ids", "get_end_effectors_ids", "get_end_effector_pose"),
    }
)
"""Methods of a robot that run on its watch lane, so that they return while an action runs."""

WITHOUT_IO: Final = frozenset(
    {
        *("id", "name", "settings", "pose", "collision_model", "enabled"),
        *("connection", "health", "move_in_progress", "shown_values"),
    }
)
"""Properties of the base classes that do no I/O. They are read on any thread."""


def overrides(cls: type[Generic], name: str) -> bool:
    """Return whether an object type overrides a member of Generic."""
    return getattr(cls, name, None) is not getattr(Generic, name)


def stop_name(cls: type[Generic]) -> str:
    """Return the name of the method that stops the devices of a type."""
    return "halt" if issubclass(cls, Axis) else "stop"


def stop_of(instance: Generic | None) -> Callable[[], Any] | None:
    """Return the method that stops a device, or None if it has none."""
    if isinstance(instance, Axis):
        return instance.halt
    found = getattr(instance, "stop", None)
    return found if callable(found) and getattr(found, "__func__", None) not in NO_STOP else None
