"""Parts shared by arm drivers: stop guards, exclusive motions, checks of arguments, and alarms for safety stops."""

import contextlib
import threading
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Final, NoReturn

from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Severity
from arcor2_hw.data.geometry import Orientation
from arcor2_hw.data.robot import Joint, Safety
from arcor2_hw.exceptions import Arcor2Error, Cancelled, InvalidData, NotFound, OutOfRange, Refused
from arcor2_hw.messages import Message, translatable
from arcor2_hw.objects.settings import within

TCP: Final = "tcp"
"""Name of the only end effector of an arm."""
_CRITICAL: Final = frozenset({Safety.FAULT, Safety.VIOLATION})


class StopCounter:
    """Count stop requests, so that a command given before a stop does not start a motion after it."""

    def __init__(self) -> None:
        self.count = 0

    def request(self) -> None:
        """Cancel all commands given so far."""
        self.count += 1

    def guard(self) -> "StopGuard":
        """Return the guard of a new command."""
        return StopGuard(self)


class StopGuard:
    """Check for one command whether a stop was requested after it was given."""

    def __init__(self, counter: StopCounter) -> None:
        self._counter, self._count = counter, counter.count

    def stopped(self) -> bool:
        """Return whether a stop was requested."""
        return self._counter.count != self._count

    def check(self, what: str) -> None:
        """Raise Cancelled if a stop was requested. `what`: name of the command, for the error."""
        if self.stopped():
            raise Cancelled("{what} was stopped.", what=what)


@contextlib.contextmanager
def exclusive_motion(lock: threading.Lock, arm: str) -> Iterator[None]:
    """Hold the motion lock of an arm. Raise Refused if the arm is executing another motion."""
    if not lock.acquire(blocking=False):
        raise Refused("{arm} is moving already. Wait until the motion ends, or stop it.", arm=arm)
    try:
        yield
    finally:
        lock.release()


def named_joints(names: Iterable[str], values: Iterable[float]) -> list[Joint]:
    """Return joints with names and values."""
    return [Joint(name, float(value)) for name, value in zip(names, values, strict=True)]


def joint_values(
    arm: str,
    joints: list[Joint],
    limits: Mapping[str, tuple[float, float]],
    slack: float = 0.0,
    wrong: type[Arcor2Error] = InvalidData,
) -> list[float]:
    """Return joint values in the order of `limits`.

    Args:
        arm: Name of the arm, for errors.
        joints: Joints in any order.
        limits: Lower and upper limit of every joint, rad.
        slack: Tolerance beyond the limits, rad; values within it are clamped.
        wrong: Error for joints that are not those of the arm.

    Raises:
        OutOfRange: A value is beyond its limits.
    """
    values = {joint.name: joint.value for joint in joints}
    if len(values) != len(joints) or values.keys() != limits.keys():
        raise wrong(
            "The joints of {arm} are {joints}; received: {received}.",
            arm=arm,
            joints=", ".join(limits),
            received=", ".join(values),
        )
    for name, (low, high) in limits.items():
        if not low - slack <= values[name] <= high + slack:
            raise OutOfRange(
                "{name} of {arm} must be {low:.3f} to {high:.3f} rad, not {value!r}.",
                name=name,
                arm=arm,
                low=low,
                high=high,
                value=values[name],
            )
    return [min(max(values[name], low), high) for name, (low, high) in limits.items()]


def check_end_effector(arm: str, end_effector: str) -> None:
    """Raise NotFound unless the end effector is the only one of an arm."""
    if end_effector != TCP:
        raise NotFound(
            "{arm} has no end effector {end_effector!r}, only {tcp!r}.", arm=arm, end_effector=end_effector, tcp=TCP
        )


def check_confirmed(confirmed_by: str) -> None:
    """Raise InvalidData if `confirmed_by` is empty. It is the name of the person who inspected the robot."""
    if not confirmed_by.strip():
        raise InvalidData("confirmed_by must name the person who inspected the robot.")


def refuse_acknowledgement(arm: str, code: str, alarms: Iterable[Alarm], action: str = "") -> NoReturn:
    """Refuse to acknowledge an alarm that only a person at the robot can acknowledge.

    Args:
        arm: Name of the arm, for errors.
        code: Code of the alarm.
        alarms: Active alarms of the arm.
        action: Method that takes the name of this person; empty: the alarm is acknowledged at the controller.

    Raises:
        NotFound: The alarm is not active.
        Refused: It is active.
    """
    if code not in {alarm.code for alarm in alarms}:
        raise NotFound("{arm} has no alarm {code}.", arm=arm, code=code)
    if not action:
        raise Refused("{code} of {arm} must be acknowledged at the controller.", code=code, arm=arm)
    raise Refused(
        "{code} of {arm} must be acknowledged by the person who inspected the robot: {action}(confirmed_by).",
        code=code,
        arm=arm,
        action=action,
    )


def check_jog(
    arm: str,
    twist: Collection[float] | None,
    velocities: Collection[float] | None,
    joints: Collection[str],
    valid_for: float,
) -> None:
    """Raise OutOfRange unless there is either a twist or a velocity for each joint, valid for 0.01 to 1 s."""
    within(f"{arm}: valid_for", valid_for, 0.01, 1.0)
    if (twist is None) == (velocities is None):
        raise OutOfRange("{arm}: jog needs either twist or joint_velocities.", arm=arm)
    if velocities is not None and len(velocities) != len(joints):
        raise OutOfRange("{arm}: joint_velocities must have {count} numbers.", arm=arm, count=len(joints))


def jog_axes(arm: str, frame: str, axes: Mapping[str, Orientation]) -> Orientation:
    """Return the axes of a frame in which an arm is jogged. Raise Refused unless `axes` contains it."""
    if frame not in axes:
        raise Refused(
            "{arm} cannot be jogged in frame {frame!r}. Use {axes}.", arm=arm, frame=frame, axes=", ".join(axes)
        )
    return axes[frame]


_LABELS: Final = translatable(
    {
        Safety.NORMAL: "normal",
        Safety.REDUCED: "reduced",
        Safety.PROTECTIVE_STOP: "protective stop",
        Safety.SAFEGUARD_STOP: "safeguard stop",
        Safety.EMERGENCY_STOP: "emergency stop",
        Safety.ENABLING_STOP: "enabling stop",
        Safety.RECOVERY: "recovery",
        Safety.VIOLATION: "violation",
        Safety.FAULT: "fault",
    }
)
"""Names of the safety states."""


class SafetyAlarm:
    """Report an active safety stop as an alarm, with the time at which it was first observed."""

    def __init__(self, remedies: Mapping[Safety, str]) -> None:
        self._remedies = remedies
        self._since = Safety.NORMAL, now()

    def alarms(self, safety: Safety) -> list[Alarm]:
        """Return the alarm of a safety state, or an empty list if the arm may move."""
        if safety is not self._since[0]:
            self._since = safety, now()
        if safety in (Safety.NORMAL, Safety.REDUCED):
            return []
        severity = Severity.CRITICAL if safety in _CRITICAL else Severity.ERROR
        return [Alarm(safety.value, severity, label(safety).text, self._remedies.get(safety, ""), self._since[1])]


def label(safety: Safety) -> Message:
    """Return the name of a safety state."""
    return Message.of(_LABELS[safety])
