"""Unit: the belt as a PackML unit, its states and commands (ISA-TR88.00.02).

Stopped: without torque. Idle: enabled, at standstill. Execute: the belt moves. Held: stopped by hold, with torque.
Aborted: after a fault or abort; at standstill without torque until it is cleared.
"""

import contextlib
import threading
from collections.abc import Callable, Iterator
from typing import Any, Final

from arcor2_hw.exceptions import Refused
from arcor2_hw.messages import Message
from arcor2_hw.objects import MachineCommand, MachineState
from arcor2_hw.objects.machine import ALLOWED
from arcor2_hw.objects.observing import GoOn

from .cia402 import FAULTY, Mode, Power, State
from .motion import Motion

S = MachineState
STATES: Final = frozenset(
    {
        S.STOPPED,
        S.RESETTING,
        S.IDLE,
        S.STARTING,
        S.EXECUTE,
        S.HOLDING,
        S.HELD,
        S.UNHOLDING,
        S.STOPPING,
        S.ABORTING,
        S.ABORTED,
        S.CLEARING,
    }
)


class Unit:
    """State that the drive does not store: held, aborted, and the running command."""

    def __init__(self, who: str | Message, motion: Motion, speed: int) -> None:
        self._who, self._motion, self._speed = who, motion, speed
        self._held_speed = 0
        self._one_act = threading.Lock()
        self._passing: MachineState | None = None
        self.held = self.aborted = False

    def forget(self) -> None:
        """Reset the state, because control has ended."""
        self.held = self.aborted = False

    def state(self, now: State) -> MachineState:
        """Return the state that the drive is in."""
        if now.power in FAULTY:
            return S.ABORTED if now.power is Power.FAULT else S.ABORTING
        stopped = self._motion.is_stopped(now)
        passing = self._passing
        if passing is not None:
            return passing
        if self.aborted:
            return S.ABORTED if stopped else S.ABORTING
        if now.power is not Power.ENABLED:
            return S.STOPPED if stopped else S.STOPPING
        if not stopped or self._one_act.locked():
            return S.EXECUTE
        return S.HELD if self.held else S.IDLE

    @contextlib.contextmanager
    def act(self, operation: str) -> Iterator[None]:
        """Run a command exclusively; it ends a hold. Raises Refused while another runs, and while aborted."""
        if self.aborted:
            raise Refused(
                "{device}: {what} is refused in state Aborted: clear it first", device=self._who, what=operation
            )
        if not self._one_act.acquire(blocking=False):
            raise Refused(
                "{device}: {what} is refused while another motion is under way", device=self._who, what=operation
            )
        try:
            self.held = False
            yield
        finally:
            self._one_act.release()

    def command(self, command: MachineCommand, now: State, go_on: GoOn) -> None:
        """Execute a PackML command on the belt and return when it is done. Raises Refused with command and state."""
        name, state = command.name.lower(), self.state(now)
        values: dict[str, Any] = {"device": self._who, "name": name, "state": state.name.capitalize()}
        acts: dict[MachineCommand, tuple[MachineState, Callable[[], None]]] = {
            MachineCommand.RESET: (S.RESETTING, lambda: self._ready(name, go_on)),
            MachineCommand.START: (S.STARTING, lambda: self._run(self._speed, name, go_on)),
            MachineCommand.HOLD: (S.HOLDING, lambda: self._hold(now, name, go_on)),
            MachineCommand.UNHOLD: (S.UNHOLDING, lambda: self._run(self._held_speed, name, go_on)),
            MachineCommand.STOP: (S.STOPPING, self._motion.halt),
            MachineCommand.ABORT: (S.ABORTING, self._abort),
            MachineCommand.CLEAR: (S.CLEARING, lambda: self._clear(go_on)),
        }
        if command not in acts:
            raise Refused("{device}: {name} is refused in state {state}: a belt has no such command", **values)
        if state not in ALLOWED[command]:
            raise Refused("{device}: {name} is refused in state {state}: this state does not allow it", **values)
        if command is MachineCommand.HOLD and now.mode != Mode.PROFILE_VELOCITY:
            raise Refused("{device}: {name} is refused in state {state}: a move cannot be held, only stopped", **values)
        passing, act = acts[command]
        self._passing = passing
        try:
            act()
        finally:
            self._passing = None

    def _ready(self, name: str, go_on: GoOn) -> None:
        with self.act(name):
            self._motion.make_ready(name, go_on)

    def _run(self, speed: int, name: str, go_on: GoOn) -> None:
        with self.act(name):
            self._motion.run(speed, name, go_on)

    def _hold(self, now: State, name: str, go_on: GoOn) -> None:
        self._held_speed = now.velocity
        self._run(0, name, go_on)
        self.held = True

    def _abort(self) -> None:
        self.aborted = True
        self._motion.quick_stop()

    def _clear(self, go_on: GoOn) -> None:
        self._motion.fault_reset(go_on)
        self.forget()

    def reason(self, now: State) -> str:
        """Return why the belt is aborted, empty when it is not."""
        if now.power in FAULTY:
            return str(self._motion.fault(now, "aborted"))
        return f"{self._who}: aborted by command" if self.aborted else ""
