"""Safety and power of a UR arm: health, alarms, and the commands that a person decides on."""

import logging
from collections.abc import Callable
from typing import Final

from arcor2_hw.data.device import Alarm, Health
from arcor2_hw.data.robot import Safety
from arcor2_hw.exceptions import DeviceTimeout, Refused
from arcor2_hw.keep_alive import once_within
from arcor2_hw.objects.arm import SafetyAlarm, check_confirmed

from .control import Control
from .observer import Observer, Sample
from .pendant import Pendant
from .states import MAY_MOVE, MODE_IDLE, MODE_RUNNING, REMEDIES, safety_of

POWER_WITHIN: Final = 20.0
"""Time from "power on" to idle, s: a controller takes six seconds, or longer if it checks its joints."""
BRAKES_WITHIN: Final = 20.0
SAFETY_WITHIN: Final = 5.0
POLL: Final = 0.02
_BROKEN: Final = frozenset({Safety.FAULT, Safety.VIOLATION})

log = logging.getLogger(__name__)


class SafetySystem:
    """The safety system and the drive power of one arm."""

    def __init__(self, observer: Observer, pendant: Pendant, control: Control) -> None:
        self._name = observer.name
        self._observer, self._pendant, self._control = observer, pendant, control
        self._alarm = SafetyAlarm(REMEDIES)

    def condition(self) -> Health:
        """Return the condition of an observed arm."""
        newest = self._observer.newest()
        safety = safety_of(newest.safety_mode) if newest is not None else Safety.NORMAL
        if safety in _BROKEN:
            return Health.FAILURE
        return Health.NORMAL if safety in MAY_MOVE else Health.CHECK_FUNCTION

    def alarms(self) -> list[Alarm]:
        """Return the active safety stop, if any."""
        newest = self._observer.newest()
        return self._alarm.alarms(safety_of(newest.safety_mode) if newest is not None else Safety.NORMAL)

    def power_on(self) -> None:
        """Switch drive power on."""
        if self._observer.sample().robot_mode >= MODE_IDLE:
            return
        self._pendant.do("power on", "Powering on")
        self._await("switch on", lambda sample: sample.robot_mode >= MODE_IDLE, POWER_WITHIN)

    def release_brakes(self) -> None:
        """Release the brakes."""
        mode = self._observer.sample().robot_mode
        if mode == MODE_RUNNING:
            return
        if mode < MODE_IDLE:
            raise Refused("{name} has no power. Switch it on before releasing the brakes.", name=self._name)
        self._pendant.do("brake release", "Brake releasing")
        self._await("release its brakes", lambda sample: sample.robot_mode == MODE_RUNNING, BRAKES_WITHIN)

    def acknowledge_protective_stop(self, confirmed_by: str) -> None:
        """Unlock a protective stop, after stopping the old program."""
        check_confirmed(confirmed_by)
        if self._safety() is not Safety.PROTECTIVE_STOP:
            raise Refused("{name} has no protective stop.", name=self._name)
        self._control.revoke("a protective stop was acknowledged")
        self._pendant.do("unlock protective stop", "Protective stop releasing")
        log.warning("%s: protective stop acknowledged by %s", self._name, confirmed_by)
        self._await("leave the protective stop", lambda sample: not _is(sample, Safety.PROTECTIVE_STOP), SAFETY_WITHIN)

    def restart(self, confirmed_by: str) -> None:
        """Restart the safety system after a fault or violation; drive power is off afterwards."""
        check_confirmed(confirmed_by)
        if self._safety() not in _BROKEN:
            raise Refused("{name} has neither a fault nor a violation of its safety system.", name=self._name)
        self._control.revoke("the safety system was restarted")
        self._pendant.do("restart safety", "Restarting safety")
        log.warning("%s: safety system restarted by %s", self._name, confirmed_by)
        self._await("restart its safety system", lambda sample: not _is(sample, *_BROKEN), POWER_WITHIN)

    def _safety(self) -> Safety:
        return safety_of(self._observer.sample().safety_mode)

    def _await(self, what: str, holds: Callable[[Sample], bool], within: float) -> None:
        if not once_within(lambda: holds(self._observer.sample(max_age=0.5)), within, POLL):
            raise DeviceTimeout(
                "{name} did not {what} within {within:g} s. Check the pendant.",
                name=self._name,
                what=what,
                within=within,
            )


def _is(sample: Sample, *states: Safety) -> bool:
    return safety_of(sample.safety_mode) in states
