"""The program of the PLC: a handshake for jobs, supervised by the life sign of the host. Pure logic."""

from __future__ import annotations

import dataclasses
import enum
from typing import Final

ABORTED: Final = 90
HOST_GONE: Final = 91
UNKNOWN_JOB: Final = 92
LIFE_STEP: Final = 0.1
"""Period of the life sign of the PLC, s."""


class Step(enum.StrEnum):
    """Step of the handshake."""

    IDLE = "idle"
    BUSY = "busy"
    STOPPING = "stopping"
    DONE = "done"
    ERROR = "error"


@dataclasses.dataclass
class Host:
    """Variables that the host writes."""

    owner: int = 0
    life: int = 0
    number: int = 0
    request: bool = False


class Program:
    """The program, executed by `scan`.

    Args:
        jobs: Duration of each job by number, s.
        ramp: Time a job takes to stop, s.
        patience: Time without a change of the life sign of the host after which it counts as disconnected, s.
    """

    def __init__(self, jobs: dict[int, float], ramp: float, patience: float) -> None:
        self.jobs, self._ramp, self._patience = dict(jobs), ramp, patience
        self.step = Step.IDLE
        self.code = 0
        self.life = 0
        self.live = True
        self.stuck = False
        self.deaf = False
        self.next_error = 0
        self.done: list[int] = []
        self.owner = 0
        self.stranger = False
        self._number = 0
        self._until = 0.0
        self._counted = 0.0
        self._host_life = 0
        self._host_seen = 0.0
        self._requested = False

    @property
    def moving(self) -> bool:
        """Return whether a job moves something."""
        return self.step in (Step.BUSY, Step.STOPPING)

    def scan(self, host: Host, time: float) -> bool:
        """Run once; return whether the host was lost in this scan, so that outputs take their state on loss."""
        if self.live and time - self._counted >= LIFE_STEP:
            self.life, self._counted = (self.life + 1) % 65536, time
        gone = self._supervise(host, time)
        if gone and self.moving:
            self._stop(time, HOST_GONE)
        if not self.deaf:
            self._handshake(host, time)
        self._requested = host.request
        return gone

    def _supervise(self, host: Host, time: float) -> bool:
        if host.owner != self.owner:
            self.owner, self._host_seen = host.owner, time
        if host.life != self._host_life:
            self._host_life, self._host_seen = host.life, time
        if self.owner and not self.stranger and time - self._host_seen > self._patience:
            self.owner = 0
            return True
        return False

    def _handshake(self, host: Host, time: float) -> None:
        if self.step is Step.IDLE:
            if host.request and not self._requested and self.owner:
                self._begin(host.number, time)
        elif self.step is Step.BUSY:
            if not host.request:
                self._stop(time, ABORTED)
            elif time >= self._until and not self.stuck:
                self._end()
        elif self.step is Step.STOPPING:
            if time >= self._until:
                self.step = Step.ERROR
        elif not host.request:
            self.step, self.code = Step.IDLE, 0

    def _begin(self, number: int, time: float) -> None:
        self.code = 0
        if number not in self.jobs:
            self.step, self.code = Step.ERROR, UNKNOWN_JOB
            return
        self.step, self._number, self._until = Step.BUSY, number, time + self.jobs[number]

    def _stop(self, time: float, code: int) -> None:
        if self.step is Step.BUSY:
            self._until = time + self._ramp
        self.step, self.code = Step.STOPPING, code

    def _end(self) -> None:
        if self.next_error:
            self.step, self.code, self.next_error = Step.ERROR, self.next_error, 0
        else:
            self.step = Step.DONE
            self.done.append(self._number)

    def restart(self) -> None:
        """Restart, as after power-on: nothing moves, nobody has control, the counters start from 0."""
        self.step, self.code, self.life, self.owner = Step.IDLE, 0, 0, 0
        self.stuck = self.deaf = self.stranger = self._requested = False
        self.live, self.next_error = True, 0
