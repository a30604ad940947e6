"""Supervision of robots in hand teaching mode: reports when the robot leaves the mode by itself."""

import threading
from collections.abc import Callable, Mapping
from typing import Any, Final

from arcor2_hw.data.robot import Safety
from arcor2_hw.exceptions import Arcor2Error, Cancelled, SafetyStop
from arcor2_hw.objects import Robot
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.lane import Job

TEACHING_PERIOD: Final = 0.1
"""Period of the check whether an arm is still in hand teaching mode, s."""
ENDED_BY: Final = frozenset(
    {Safety.PROTECTIVE_STOP, Safety.SAFEGUARD_STOP, Safety.EMERGENCY_STOP, Safety.VIOLATION, Safety.FAULT}
)
"""Safety states that end hand teaching, even if the driver still reports the mode."""
SET_MODE: Final = "set_hand_teaching_mode"


class Teaching:
    """Check the arms in hand teaching mode.

    Args:
        ended: Called once when an arm has left the mode without a request, with the device, the argument that names the
            arm, and the reason.
    """

    def __init__(self, ended: Callable[[Device, Mapping[str, Any], Arcor2Error], None]) -> None:
        self._ended = ended
        self._lock = threading.Lock()
        self._arms: dict[tuple[str, str], tuple[Device, Mapping[str, Any]]] = {}
        self._pending: dict[tuple[str, str], Job] = {}

    def set(self, device: Device, arm: Mapping[str, Any], enabled: bool) -> None:
        """Record that hand teaching of an arm was switched on or off by a request."""
        with self._lock:
            if enabled:
                self._arms[_key(device, arm)] = device, arm
            else:
                self._arms.pop(_key(device, arm), None)

    def check_all(self) -> None:
        """Start the check of every arm. Runs on the thread of the clock."""
        with self._lock:
            arms = dict(self._arms)
        for key, (device, arm) in arms.items():
            pending = self._pending.get(key)
            if device.instance is None or device.closing:
                self.set(device, arm, False)
            elif pending is None or pending.ended:
                job = self._pending[key] = Job("hand teaching", self._check, (device, arm))
                device.watch_lane.submit_or_fail(job)

    def _check(self, device: Device, arm: Mapping[str, Any]) -> None:
        robot = device.require()
        assert isinstance(robot, Robot)
        on = robot.get_hand_teaching_mode(**arm)
        safety = _safety(robot)
        if on and safety not in ENDED_BY:
            return
        with self._lock:
            if self._arms.pop(_key(device, arm), None) is None:
                return  # a request has switched it off
        error: Arcor2Error = Cancelled("{name}: hand teaching was ended by the robot", name=device.name)
        if safety in ENDED_BY:
            what = safety.replace("_", " ")
            error = SafetyStop(
                "{name}: hand teaching was ended, safety state: {what}", "", safety, name=device.name, what=what
            )
        self._ended(device, arm, error)


def _key(device: Device, arm: Mapping[str, Any]) -> tuple[str, str]:
    return device.id, arm.get("arm_id", "")


def _safety(robot: Robot) -> Safety:
    """Return the safety state; normal for a robot that cannot report it."""
    try:
        return robot.state().safety
    except Exception:  # noqa: BLE001 - a driver may raise anything; only the mode counts then
        return Safety.NORMAL
