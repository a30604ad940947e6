"""The tool and its programs, without the protocol: enabling, tightening, results and alarms."""

from __future__ import annotations

import asyncio
import random
from collections import deque
from collections.abc import Callable
from datetime import datetime

import msgspec

_TORQUE = (10.8, 13.2, 12.0)  # N m: lowest, highest, target
_ANGLE = (20, 90, 55)  # degrees
_SPREAD = (0.3, 8.0)  # N m, degrees
_HIGHEST_TORQUE, _HIGHEST_ANGLE = 9999.99, 99999


class Tightening(msgspec.Struct, frozen=True):
    """The result of a tightening. Torque in N m, angle in degrees; a status is 0 low, 1 OK, 2 high."""

    id: int
    program: int
    job: int
    torque: float
    angle: int
    at: datetime
    torque_limits: tuple[float, float, float] = _TORQUE
    angle_limits: tuple[int, int, int] = _ANGLE

    @property
    def torque_status(self) -> int:
        """Return the status of the torque."""
        return _status(self.torque, *self.torque_limits[:2])

    @property
    def angle_status(self) -> int:
        """Return the status of the angle."""
        return _status(self.angle, *self.angle_limits[:2])

    @property
    def ok(self) -> bool:
        """Return whether torque and angle are within their limits."""
        return self.torque_status == self.angle_status == 1


def _status(value: float, low: float, high: float) -> int:
    return 0 if value < low else 2 if value > high else 1


class Alarm(msgspec.Struct, frozen=True):
    """An active alarm."""

    code: str
    text: str
    controller_ready: bool
    tool_ready: bool
    at: datetime


class Tool:
    """A handheld tool with a trigger.

    Args:
        programs: Number of programs; they are numbered from 1.
        jobs: Number of jobs; they are numbered from 1.
        duration: Duration of a tightening, s.
        evaluation: Time from its end to its result, s.
        automatic: Whether the trigger is always held, so that an enabled tool tightens again and again.
        seed: Seed of torque and angle.
    """

    def __init__(
        self,
        *,
        programs: int,
        jobs: int,
        duration: float,
        evaluation: float = 0.05,
        automatic: bool = False,
        seed: int = 0,
    ) -> None:
        self.programs, self.jobs = programs, jobs
        self._duration, self._evaluation = duration, evaluation
        self._automatic, self._seed = automatic, seed
        self._loop = asyncio.get_running_loop()
        self.finished: Callable[[Tightening], None] = lambda _: None
        self.alarm_raised: Callable[[Alarm], None] = lambda _: None
        self.alarm_cleared: Callable[[Alarm], None] = lambda _: None
        self._motor: asyncio.TimerHandle | None = None
        self._evaluations: list[asyncio.TimerHandle] = []
        self.renew()

    def renew(self) -> None:
        """Return to the state after the start."""
        self.power_on()
        self._random = random.Random(self._seed)
        self.program, self.job, self.made, self.serviced = 1, 0, 0, 0
        self.last: Tightening | None = None
        self.planned: deque[tuple[float, int]] = deque()

    def power_on(self) -> None:
        """Boot: the tool is disabled, its program and the number of tightenings are stored."""
        self._halt()
        for evaluation in self._evaluations:
            evaluation.cancel()
        self._evaluations.clear()
        self.enabled = False
        self.pulls = 0
        self.alarm: Alarm | None = None

    @property
    def running(self) -> bool:
        """Return whether the motor runs."""
        return self._motor is not None

    # ------------------------------------------------------------------------------------------------ the operator

    def pull(self, times: int) -> None:
        """Pull the trigger. It stays pulled until the tool has tightened `times` times."""
        self.pulls += times
        self._start()

    def tighten_once(self) -> None:
        """Tighten immediately, whether enabled or not, as by a test function of the controller."""
        if self._motor is None:
            self._shut_off()

    def plan(self, torque: float, angle: int) -> None:
        """Set torque (N m) and angle (degrees) of a later tightening, in order."""
        if not (0.0 <= torque <= _HIGHEST_TORQUE and 0 <= angle <= _HIGHEST_ANGLE):
            raise ValueError(f"torque must be 0 to {_HIGHEST_TORQUE}, angle 0 to {_HIGHEST_ANGLE}")
        self.planned.append((torque, angle))

    def raise_alarm(self, alarm: Alarm) -> None:
        """Raise an alarm. It stops the motor unless controller and tool stay ready."""
        self.alarm = alarm
        self.alarm_raised(alarm)
        if not self._ready:
            self._abort()

    def clear_alarm(self) -> bool:
        """Acknowledge the alarm. Return whether there was one."""
        alarm, self.alarm = self.alarm, None
        if alarm is None:
            return False
        self.alarm_cleared(alarm)
        self._start()
        return True

    def service(self) -> None:
        """Record that the tool was serviced."""
        self.serviced = self.made

    # ------------------------------------------------------------------------------------------------ the controller

    def enable(self, on: bool) -> None:
        """Enable or disable the tool. Disabling stops the motor."""
        self.enabled = on
        if on:
            self._start()
        else:
            self._abort()

    @property
    def _ready(self) -> bool:
        return self.alarm is None or (self.alarm.controller_ready and self.alarm.tool_ready)

    def _start(self) -> None:
        if self.enabled and self._ready and not self.running and (self.pulls or self._automatic):
            self._motor = self._loop.call_later(self._duration, self._shut_off)

    def _halt(self) -> None:
        if self._motor is not None:
            self._motor.cancel()
        self._motor = None

    def _abort(self) -> None:
        """Stop a tightening early: its torque is too low."""
        if self.running:
            self._halt()
            self._evaluate(_TORQUE[0] / 4.0, _ANGLE[0])

    def _shut_off(self) -> None:
        self._motor = None
        if self.planned:
            torque, angle = self.planned.popleft()
        else:
            torque = self._random.uniform(_TORQUE[2] - _SPREAD[0], _TORQUE[2] + _SPREAD[0])
            angle = round(self._random.uniform(_ANGLE[2] - _SPREAD[1], _ANGLE[2] + _SPREAD[1]))
        self._evaluate(torque, angle)
        self._start()

    def _evaluate(self, torque: float, angle: int) -> None:
        self.pulls = max(0, self.pulls - 1)
        self._evaluations.append(self._loop.call_later(self._evaluation, self._report, torque, angle))

    def _report(self, torque: float, angle: int) -> None:
        del self._evaluations[0]
        self.made += 1
        self.last = Tightening(self.made, self.program, self.job, round(torque, 2), angle, datetime.now())  # noqa: DTZ005
        self.finished(self.last)
