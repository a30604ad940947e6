"""Safety and power of a UR arm: health, alarms, and the commands that a person decides on."""

import logging
from collections.abc import Callable
from typing import Final

from arcor2_hw.data.device import Alarm, Health
from arcor2_hw.data.robot import Safety
from arcor2_hw.exceptions import DeviceTimeout, Refused
from arcor2_hw.keep_alive import once_within
from arcor2_hw.objects.arm import SafetyAlarm, check_confirmed, refuse_acknowledgement

from .control import Control
from .observer import Observer, Sample
from .pendant import Pendant
from .states import MAY_MOVE, MODE_IDLE, MODE_RUNNING, safety_of

POWER_TIMEOUT: Final = 20.0
"""Time from "power on" to idle, s: a controller takes six seconds, or longer if it checks its joints."""
BRAKE_RELEASE_TIMEOUT: Final = 20.0
SAFETY_TIMEOUT: Final = 5.0
POLL_INTERVAL: Final = 0.02
_BROKEN: Final = frozenset({Safety.FAULT, Safety.VIOLATION})

log = logging.getLogger(__name__)


class SafetySystem:
    """Mixin of an arm: its health and alarms, and the commands that a person decides on."""

    name: str
    _observer: Observer
    _pendant: Pendant
    _control: Control
    _safety_alarm: SafetyAlarm

    def condition(self) -> Health:
        """Return the condition of the arm."""
        safety = self._newest_safety() if self._observer.observing.online else Safety.NORMAL
        if safety in _BROKEN:
            return Health.FAILURE
        return Health.NORMAL if safety in MAY_MOVE else Health.CHECK_FUNCTION

    def alarms(self) -> list[Alarm]:
        """Return the active safety stop, if any."""
        return self._safety_alarm.alarms(self._newest_safety())

    def acknowledge(self, code: str) -> None:
        """Raise Refused: only a named person can acknowledge a safety stop. Raise NotFound for an inactive alarm."""
        refuse_acknowledgement(self.name, code, self.alarms(), "acknowledge_protective_stop")

    def power_on(self) -> None:
        """Switch drive power on; brakes stay closed. Raise NotInControl, Refused or DeviceTimeout."""
        if self._observer.sample().robot_mode >= MODE_IDLE:
            return
        self._pendant.do("power on", "Powering on")
        self._await("switch on", lambda sample: sample.robot_mode >= MODE_IDLE, POWER_TIMEOUT)

    def release_brakes(self) -> None:
        """Release the brakes; the arm does not move. Raise NotInControl, Refused or DeviceTimeout."""
        mode = self._observer.sample().robot_mode
        if mode == MODE_RUNNING:
            return
        if mode < MODE_IDLE:
            raise Refused("{name} has no power. Switch it on before releasing the brakes.", name=self.name)
        self._pendant.do("brake release", "Brake releasing")
        self._await("release its brakes", lambda sample: sample.robot_mode == MODE_RUNNING, BRAKE_RELEASE_TIMEOUT)

    def acknowledge_protective_stop(self, confirmed_by: str) -> None:
        """Unlock a protective stop, at the earliest 5 s after it; the old motion does not continue."""
        check_confirmed(confirmed_by)
        if self._safety() is not Safety.PROTECTIVE_STOP:
            raise Refused("{name} has no protective stop.", name=self.name)
        self._control.revoke("a protective stop was acknowledged")
        self._pendant.do("unlock protective stop", "Protective stop releasing")
        log.warning("%s: protective stop acknowledged by %s", self.name, confirmed_by)
        self._await("leave the protective stop", lambda sample: not _is(sample, Safety.PROTECTIVE_STOP), SAFETY_TIMEOUT)

    def restart_safety(self, confirmed_by: str) -> None:
        """Restart the safety system after a fault or violation; drive power is off afterwards."""
        check_confirmed(confirmed_by)
        if self._safety() not in _BROKEN:
            raise Refused("{name} has neither a fault nor a violation of its safety system.", name=self.name)
        self._control.revoke("the safety system was restarted")
        self._pendant.do("restart safety", "Restarting safety")
        log.warning("%s: safety system restarted by %s", self.name, confirmed_by)
        self._await("restart its safety system", lambda sample: not _is(sample, *_BROKEN), POWER_TIMEOUT)

    def _newest_safety(self) -> Safety:
        newest = self._observer.newest()
        return safety_of(newest.safety_mode) if newest is not None else Safety.NORMAL

    def _safety(self) -> Safety:
        return safety_of(self._observer.sample().safety_mode)

    def _await(self, operation: str, holds: Callable[[Sample], bool], within: float) -> None:
        if not once_within(lambda: holds(self._observer.sample(max_age=0.5)), within, POLL_INTERVAL):
            raise DeviceTimeout(
                "{name} did not {what} within {within:g} s. Check the pendant.",
                name=self.name,
                what=operation,
                within=within,
            )


def _is(sample: Sample, *states: Safety) -> bool:
    return safety_of(sample.safety_mode) in states
