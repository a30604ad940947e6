"""Selects the requests for the audit trail, and determines their targets."""

from typing import Any, Final

from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import WITHOUT_PERSON, Rpc

READING: Final = frozenset(
    {
        "ActionParamValues",
        "AlarmStatistics",
        "Authenticate",
        "CameraColorImage",
        "CameraColorParameters",
        "CheckCalibration",
        "CheckScript",
        "CompareParameters",
        "ExportFunction",
        "ForwardKinematics",
        "History",
        "InverseKinematics",
        "MarkersCorners",
        "ObjectTypeUsage",
        "ProjectScript",
        "ProjectsWithScene",
        "Reachability",
        "SceneObjectUsage",
        "SystemInfo",
        "Version",
    }
)
"""Requests that change nothing, in addition to those whose names start with Get and List."""
CLIENT_STATE: Final = frozenset(
    {
        "KeepLoggedOn",
        "LogOff",
        "PreviewMove",
        "ReadLock",
        "ReadUnlock",
        "RenewForces",
        "RegisterForRobotEvent",
        "RegisterUser",
        "SetViewState",
        "StreamObservations",
        "StreamPoints",
        "StreamRobot",
        "SubscribeEvents",
        "UpdateLock",
        "UpdatePresence",
        "WriteLock",
        "WriteUnlock",
    }
)
"""Requests that change only the state of a client, such as its view, subscriptions and locks.

LogOff has an entry with its reason, also when the server logs a person off.
"""
_TARGETS: Final = (
    *("robot_id", "object_id", "object_type_id", "package_id", "action_point_id", "orientation_id", "joints_id"),
    *("action_id", "logic_item_id", "project_id", "scene_id", "id", "target_id", "original_id"),
    *("start", "name", "type", "person"),
)
"""Argument fields that identify the target of a request, most specific first. Their values are not secret."""
MAX_TARGET: Final = 100
"""Maximum length of the target of an entry."""


def is_command(rpc: Rpc) -> bool:
    """Return whether a request moves or changes something."""
    return not (rpc.name.startswith(("Get", "List")) or rpc.name in READING or rpc.name in CLIENT_STATE)


def needs_person(rpc: Rpc) -> bool:
    """Return whether a shared device may send a request only while a person is logged on."""
    return rpc.name not in WITHOUT_PERSON and (is_command(rpc) or rpc.role > Role.OPERATOR)


def target_of(args: Any) -> str:
    """Return the target that the arguments of a request name; empty if they name none."""
    robot = getattr(args, "robot", None)
    for each in (args, robot):
        for name in _TARGETS:
            value = getattr(each, name, None)
            if isinstance(value, str) and value:
                return value[:MAX_TARGET]
    if isinstance(args, set | frozenset):
        return ", ".join(sorted(map(str, args)))[:MAX_TARGET]
    return ""
