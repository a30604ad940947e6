"""Robots in hand teaching mode: checked, so that an end without a request is reported."""

import threading
from collections.abc import Callable, Mapping
from typing import Any, Final

from arcor2_hw.data.robot import Safety
from arcor2_hw.exceptions import Arcor2Error, Cancelled, SafetyStop
from arcor2_hw.objects import Robot
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.lane import Job

TEACHING_PERIOD: Final = 0.1
"""Seconds between two checks whether an arm is still in hand teaching mode."""
ENDED_BY: Final = frozenset(
    {Safety.PROTECTIVE_STOP, Safety.SAFEGUARD_STOP, Safety.EMERGENCY_STOP, Safety.VIOLATION, Safety.FAULT}
)
"""Safety states in which an arm is not in hand teaching mode, whatever the driver reports."""
SET_MODE: Final = "set_hand_teaching_mode"


class Teaching:
    """`ended` is called, once per arm, when hand teaching has ended without a request: device, arm argument, reason."""

    def __init__(self, ended: Callable[[Device, Mapping[str, Any], Arcor2Error], None]) -> None:
        self._ended = ended
        self._lock = threading.Lock()
        self._arms: dict[tuple[str, str], tuple[Device, Mapping[str, Any]]] = {}
        self._pending: dict[tuple[str, str], Job] = {}

    def set(self, device: Device, arm: Mapping[str, Any], enabled: bool) -> None:
        """Note that hand teaching of an arm was switched on or off by request."""
        with self._lock:
            if enabled:
                self._arms[_key(device, arm)] = device, arm
            else:
                self._arms.pop(_key(device, arm), None)

    def check_all(self) -> None:
        """Start to check every arm. On the clock's thread."""
        with self._lock:
            arms = dict(self._arms)
        for key, (device, arm) in arms.items():
            pending = self._pending.get(key)
            if device.instance is None or device.closing:
                self.set(device, arm, False)
            elif pending is None or pending.ended:
                job = self._pending[key] = Job("hand teaching", self._check, (device, arm))
                try:
                    device.watch_lane.submit(job)
                except Arcor2Error as error:  # the lane hangs
                    job.finish(None, error)

    def _check(self, device: Device, arm: Mapping[str, Any]) -> None:
        robot = device.require()
        assert isinstance(robot, Robot)
        on = robot.get_hand_teaching_mode(**arm)
        safety = _safety(robot)
        if on and safety not in ENDED_BY:
            return
        with self._lock:
            if self._arms.pop(_key(device, arm), None) is None:
                return  # switched off meanwhile
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
    except Exception:  # noqa: BLE001 - whatever a driver raises; the mode alone decides then
        return Safety.NORMAL
