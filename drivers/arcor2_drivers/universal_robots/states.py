"""Conversion of the controller's numbers to states of a robot: mode, safety, program.

Source: Universal Robots, "RTDE guide": robot_mode, safety_mode, runtime_state.
"""

import enum
from typing import Final

from arcor2_hw.data.robot import Power, Safety
from arcor2_hw.messages import translatable


class Runtime(enum.IntEnum):
    """Values of runtime_state."""

    STOPPING = 0
    STOPPED = 1
    PLAYING = 2
    PAUSING = 3
    PAUSED = 4
    RESUMING = 5


MODE_IDLE: Final = 5
MODE_RUNNING: Final = 7
MODE_UPDATING: Final = 8
MODE_NAMES: Final = {
    -1: "no controller",
    0: "disconnected",
    1: "safety configuration to be confirmed",
    2: "booting",
    3: "power off",
    4: "power on",
    MODE_IDLE: "idle, brakes closed",
    6: "backdrive",
    MODE_RUNNING: "running",
    MODE_UPDATING: "updating firmware",
}

_SAFETY: Final = {
    1: Safety.NORMAL,
    2: Safety.REDUCED,
    3: Safety.PROTECTIVE_STOP,
    4: Safety.RECOVERY,
    5: Safety.SAFEGUARD_STOP,
    6: Safety.EMERGENCY_STOP,
    7: Safety.EMERGENCY_STOP,
    8: Safety.VIOLATION,
    9: Safety.FAULT,
    10: Safety.FAULT,
    11: Safety.FAULT,
    12: Safety.SAFEGUARD_STOP,
    13: Safety.ENABLING_STOP,
}

MAY_MOVE: Final = frozenset({Safety.NORMAL, Safety.REDUCED})
MAY_MOVE_MODES: Final = frozenset(mode for mode, safety in _SAFETY.items() if safety in MAY_MOVE)
"""Values of safety_mode in which the arm may move."""

REMEDIES: Final = translatable(
    {
        Safety.PROTECTIVE_STOP: "Find out why the arm was stopped, then acknowledge the protective stop.",
        Safety.SAFEGUARD_STOP: "Close the guard, then start the motion again.",
        Safety.EMERGENCY_STOP: "Release the emergency stop, then switch the arm on again.",
        Safety.ENABLING_STOP: "Hold the enabling device in its middle position.",
        Safety.RECOVERY: "Move the arm back within its limits at the pendant.",
        Safety.VIOLATION: "Find out why a safety limit was exceeded, then restart the safety system.",
        Safety.FAULT: "Read the log at the pendant, then restart the safety system.",
    }
)


def safety_of(safety_mode: int) -> Safety:
    """Return the safety state of a safety_mode; an unknown number counts as a fault."""
    return _SAFETY.get(safety_mode, Safety.FAULT)


def power_of(robot_mode: int) -> Power:
    """Return the state of the drives of a robot_mode."""
    if robot_mode < MODE_IDLE or robot_mode == MODE_UPDATING:
        return Power.OFF
    return Power.IDLE_BRAKED if robot_mode == MODE_IDLE else Power.OPERATIONAL


def program_plays(runtime: int) -> bool:
    """Return whether a program is playing or paused."""
    return runtime not in (Runtime.STOPPED, Runtime.STOPPING)
