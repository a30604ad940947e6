"""Time limits of the driver and of motions."""

import math
from collections.abc import Sequence
from typing import Final

from arcor2_hw.data.geometry import Pose

DURATION_FACTOR: Final = 1.5
"""Factor on the computed time of a move, because the controller also applies limits of its own."""
DURATION_MARGIN: Final = 3.0
"""Time added to the computed time of a move, s: for sending the command and for settling."""
MIN_SPEED_FRACTION: Final = 0.05
"""Minimum setting of the speed slider that extends the time limit of a move; lower ones count as this value."""
ROTATION_SPEED: Final = 0.5
"""Lowest angular speed of the tool in a linear move, rad/s."""

STREAM_FREQUENCY: Final = 100.0
"""Frequency of ur_rtde's stream, Hz. Compared with 500 Hz, a command takes 20 ms instead of 4 ms, and the process 5 %
of a core instead of 10 %."""
TAKE_TIMEOUT: Final = 8.0
"""Time the controller may take to start the control program, s; 0.3 s on an idle computer, over 4 s on a busy one."""
CALL_TIMEOUT: Final = 2.0
"""Time for a command that moves nothing, s; 0.03 s on an idle computer. The library itself waits 4 to 300 s."""
RESUME_TIMEOUT: Final = 4.0
"""Time for the control program to play again after a motion program, s; it takes 0.1 s."""
GUARD_PERIOD: Final = 0.01
"""Time between two checks of the guard, s."""
GUARD_END_TIMEOUT: Final = 1.0
"""Time the guard of an ended session may take to finish, s."""
STOP_REACTION_TIMEOUT: Final = 0.08
"""Time the control program may take to react to a stop before the dashboard is used, s: twice that of two commands."""
JOG_STOP_TIMEOUT: Final = 0.4
"""Time for stopping a jog, s: the command returns when the arm is at standstill."""
LAST_STOP_TIMEOUT: Final = 0.3
"""Time for the dashboard to answer the stop at the end of a session, s."""
PROGRAM_GONE_TIMEOUT: Final = 0.1
"""Time for which our program may be reported as not playing before the session ends, s by the controller's clock: two
streams report it at different times."""
PROGRAM_END_TIMEOUT: Final = 0.3
"""Time for which taking control waits for the end of another program, s."""
PROCESS_END_TIMEOUT: Final = 0.6
"""Time for the control process to report why our program is not playing, and to end after it was killed, s. The guard
does not signal during this time, so it is below the 0.8 s after which the cell host counts as frozen."""
POLL_INTERVAL: Final = 0.005
"""Time between two checks for the end of a motion, s."""
STANDSTILL_TIMEOUT: Final = 2.0
"""Time after which a stopped arm must be at standstill, s; from full speed it takes 0.3 s."""
STALLED_MOVE_TIMEOUT: Final = 0.5
"""Time an arm may be at standstill, short of its target and with no motion running, before the move has failed, s."""
START_TIMEOUT: Final = 1.0
"""Time from sending a motion program to its first line, s; a controller takes some tens of milliseconds."""


def trapezoid(distance: float, speed: float, acceleration: float) -> float:
    """Return the duration of a motion from standstill to standstill with a trapezoidal speed profile, s."""
    ramp = speed * speed / acceleration
    if distance >= ramp:
        return distance / speed + speed / acceleration
    return 2.0 * math.sqrt(distance / acceleration)


def joint_budget(start: Sequence[float], target: Sequence[float], speed: float, acceleration: float) -> float:
    """Return the time limit of a joint motion with the speed slider at 100 %, s."""
    longest = max(abs(b - a) for a, b in zip(start, target, strict=True))
    return DURATION_FACTOR * trapezoid(longest, speed, acceleration) + DURATION_MARGIN


def linear_budget(start: Pose, target: Pose, speed: float, acceleration: float) -> float:
    """Return the time limit of a linear motion with the speed slider at 100 %, s."""
    distance = start.position.distance_to(target.position)
    angle = start.orientation.angle_to(target.orientation)
    return DURATION_FACTOR * (trapezoid(distance, speed, acceleration) + angle / ROTATION_SPEED) + DURATION_MARGIN


def path_budget(budgets: Sequence[float]) -> float:
    """Return the time limit of consecutive motions, s, from those of the single motions."""
    return sum(budgets) - DURATION_MARGIN * (len(budgets) - 1)
