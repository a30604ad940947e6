"""States of the controller as numbers and names on the wire. Source: Universal Robots, RTDE and dashboard manuals."""

from enum import IntEnum


class RobotMode(IntEnum):
    """RTDE robot_mode; the names are the dashboard's."""

    NO_CONTROLLER = -1
    DISCONNECTED = 0
    CONFIRM_SAFETY = 1
    BOOTING = 2
    POWER_OFF = 3
    POWER_ON = 4
    IDLE = 5
    BACKDRIVE = 6
    RUNNING = 7


class SafetyMode(IntEnum):
    """RTDE safety_mode; the names are the dashboard's."""

    NORMAL = 1
    REDUCED = 2
    PROTECTIVE_STOP = 3
    RECOVERY = 4
    SAFEGUARD_STOP = 5
    SYSTEM_EMERGENCY_STOP = 6
    ROBOT_EMERGENCY_STOP = 7
    VIOLATION = 8
    FAULT = 9


class Runtime(IntEnum):
    """RTDE runtime_state."""

    STOPPING = 0
    STOPPED = 1
    PLAYING = 2
    PAUSING = 3
    PAUSED = 4
    RESUMING = 5


class JointMode(IntEnum):
    """RTDE joint_mode."""

    BACKDRIVE = 238
    POWER_OFF = 239
    VIOLATION = 251
    FAULT = 252
    RUNNING = 253
    IDLE = 255


_STOPPED = 1 << 10  # stopped due to safety

SAFETY_BITS = {
    SafetyMode.NORMAL: 1,
    SafetyMode.REDUCED: 1 << 1,
    SafetyMode.PROTECTIVE_STOP: 1 << 2 | _STOPPED,
    SafetyMode.RECOVERY: 1 << 3,
    SafetyMode.SAFEGUARD_STOP: 1 << 4 | _STOPPED,
    SafetyMode.SYSTEM_EMERGENCY_STOP: 1 << 5 | 1 << 7 | _STOPPED,
    SafetyMode.ROBOT_EMERGENCY_STOP: 1 << 6 | 1 << 7 | _STOPPED,
    SafetyMode.VIOLATION: 1 << 8 | _STOPPED,
    SafetyMode.FAULT: 1 << 9 | _STOPPED,
}

MAY_MOVE = frozenset({SafetyMode.NORMAL, SafetyMode.REDUCED})
