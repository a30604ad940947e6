"""The drive: power state machine and motion of CiA 402-2, without CAN. `advance` advances the time."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass

SWITCH_AT = 4000
"""Position of the home switch above the position at power-on, counts."""
FOLLOWING_ERROR, HEARTBEAT_ERROR = 0x8611, 0x8130


class State(enum.IntEnum):
    """Power states with their bits in the status word (mask 6Fh)."""

    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP_ACTIVE = 0x07
    FAULT_REACTION_ACTIVE = 0x0F
    FAULT = 0x08


class Mode(enum.IntEnum):
    """Modes of operation (6060h)."""

    NONE = 0
    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    HOMING = 6


@dataclass
class Parameters:
    """Parameters of the drive from the dictionary; counts, counts/s, counts/s²."""

    abort_option: int = 0
    target_position: int = 0
    profile_velocity: int = 5000
    acceleration: int = 20000
    deceleration: int = 20000
    quick_stop_deceleration: int = 50000
    quick_stop_option: int = 2
    target_velocity: int = 0
    homing_method: int = 0
    homing_speed: int = 2000
    homing_acceleration: int = 20000
    home_offset: int = 0


_P = State
_MOVING = (_P.OPERATION_ENABLED, _P.QUICK_STOP_ACTIVE, _P.FAULT_REACTION_ACTIVE)


class Drive:
    """The drive with its belt. It calls `emergency` with the code of a fault, and with 0 when the fault is reset."""

    def __init__(self, emergency: Callable[[int], None]) -> None:
        self._emergency = emergency
        self.power_on(0.0)

    def power_on(self, belt: float) -> None:
        """Switch on with the belt stopped at `belt` counts: volatile values are reset, and faults end."""
        self.parameters = Parameters()
        self.state = _P.SWITCH_ON_DISABLED
        self.mode = Mode.NONE
        self.controlword = 0
        self.error_code = 0
        self.cause_stands = False
        self.homed = False
        self.homing_fails = False
        self.handshake_stuck = False
        self.jammed = False
        self.belt = belt  # real position, counts
        self.velocity = 0.0
        self._offset = belt
        self._target: float | None = None  # in counts of the belt
        self._acknowledge = False
        self._reached = False
        self._homing = ""  # "", running, attained, error

    # -------------------------------------------------------------------------------- values in the object dictionary
    @property
    def position(self) -> int:
        """Return the position actual value (6064h)."""
        return round(self.belt - self._offset)

    @property
    def statusword(self) -> int:
        """Return the status word (6041h)."""
        word = int(self.state) | 0x0210  # remote, voltage enabled
        if self._reached:
            word |= 1 << 10
        if self.mode is Mode.PROFILE_POSITION and self._acknowledge:
            word |= 1 << 12
        if self.mode is Mode.PROFILE_VELOCITY and abs(self.velocity) < 1.0:
            word |= 1 << 12
        if self.mode is Mode.HOMING:
            word |= (self._homing == "attained") << 12 | (self._homing == "error") << 13
        return word

    def set_mode(self, mode: int) -> None:
        """Set the mode of operation (6060h). Raises ValueError for an unsupported mode."""
        wanted = Mode(mode)
        if wanted is not self.mode:
            self.mode, self._target, self._homing = wanted, None, ""
            self._acknowledge = self._reached = False

    # -------------------------------------------------------------------------------- control word
    def control(self, word: int) -> None:
        """Execute a control word (6040h)."""
        before, self.controlword = self.controlword, word
        rising = word & ~before
        if self.state is _P.FAULT:
            if rising & 0x80 and not self.cause_stands:
                self.state, self.error_code = _P.SWITCH_ON_DISABLED, 0
                self._emergency(0)
            return
        if self.state in (_P.FAULT_REACTION_ACTIVE, _P.QUICK_STOP_ACTIVE):
            if self.state is _P.QUICK_STOP_ACTIVE and not word & 2:
                self._power_off(_P.SWITCH_ON_DISABLED)
            return
        self._power(word)
        if self.state is _P.OPERATION_ENABLED:
            self._operate(word, rising)

    def _power(self, word: int) -> None:
        state = self.state
        if not word & 0b010 or (not word & 0b100 and state is not _P.OPERATION_ENABLED):
            self._power_off(_P.SWITCH_ON_DISABLED)  # disable voltage
        elif not word & 0b100:
            self.quick_stop()
        elif not word & 0b001:
            self._power_off(_P.READY_TO_SWITCH_ON)
        elif state is _P.READY_TO_SWITCH_ON:
            self.state = _P.SWITCHED_ON
        elif state is _P.SWITCHED_ON and word & 0b1000:
            self.state, self._target, self._reached = _P.OPERATION_ENABLED, None, False
        elif state is _P.OPERATION_ENABLED and not word & 0b1000:
            self._power_off(_P.SWITCHED_ON)

    def _operate(self, word: int, rising: int) -> None:
        if self.mode is Mode.PROFILE_POSITION:
            if rising & 0x10 and not self._acknowledge and not self.handshake_stuck:
                relative = self.belt if word & 0x40 else self._offset
                self._target = relative + self.parameters.target_position
                self._acknowledge, self._reached = True, False
            elif not word & 0x10:
                self._acknowledge = False
        elif self.mode is Mode.HOMING and rising & 0x10:
            self._homing, self._reached = "running", False

    def _power_off(self, state: State) -> None:
        self.state, self.velocity, self._target = state, 0.0, None
        self._homing = "" if self._homing == "running" else self._homing

    # -------------------------------------------------------------------------------- stops
    def quick_stop(self) -> None:
        """Stop on the quick-stop ramp, then switch the torque off (605Ah = 2)."""
        if self.state is _P.OPERATION_ENABLED:
            self.state = _P.QUICK_STOP_ACTIVE

    def fault(self, code: int, *, stands: bool = False) -> None:
        """Raise a fault: stop on the quick-stop ramp, then enter the state Fault."""
        self.error_code, self.cause_stands = code, stands
        if self.state is not _P.FAULT:
            self.state = _P.FAULT_REACTION_ACTIVE if self.state in _MOVING else _P.FAULT
        self._emergency(code)

    def connection_aborted(self) -> None:
        """React as configured in 6007h: the master is lost, or the node leaves Operational."""
        option = self.parameters.abort_option
        if self.state is not _P.OPERATION_ENABLED or option == 0:
            return
        if option == 1:
            self.fault(HEARTBEAT_ERROR)
        elif option == 2:
            self._power_off(_P.SWITCH_ON_DISABLED)
        else:
            self.quick_stop()

    # -------------------------------------------------------------------------------- motion
    def advance(self, dt: float) -> None:
        """Advance the time by `dt` s."""
        if self.state not in _MOVING:
            return
        p = self.parameters
        if self.state is not _P.OPERATION_ENABLED:
            self._ramp(0.0, p.quick_stop_deceleration, dt)
            if self.velocity == 0.0:
                self._power_off(_P.FAULT if self.state is _P.FAULT_REACTION_ACTIVE else _P.SWITCH_ON_DISABLED)
            return
        if self.controlword & 0x100:  # halt
            self._ramp(0.0, p.deceleration, dt)
            self._reached = self.velocity == 0.0
        elif self.mode is Mode.PROFILE_VELOCITY:
            faster = abs(p.target_velocity) > abs(self.velocity)
            self._ramp(p.target_velocity, p.acceleration if faster else p.deceleration, dt)
            self._reached = self.velocity == p.target_velocity
        elif self.mode is Mode.PROFILE_POSITION and self._target is not None:
            self._approach(self._target, p.profile_velocity, dt)
        elif self.mode is Mode.HOMING and self._homing == "running":
            self._home(dt)
        else:
            self._ramp(0.0, p.deceleration, dt)
        if self.jammed and abs(self.velocity) > 100.0:
            self.velocity = 0.0
            self.fault(FOLLOWING_ERROR, stands=False)

    def _ramp(self, target: float, rate: float, dt: float) -> None:
        change = max(-rate * dt, min(rate * dt, target - self.velocity))
        before, self.velocity = self.velocity, self.velocity + change
        if not self.jammed:
            self.belt += 0.5 * (before + self.velocity) * dt

    def _approach(self, target: float, fastest: float, dt: float) -> None:
        left = target - self.belt
        slow = self.parameters.deceleration
        allowed = min(fastest, math.sqrt(2.0 * slow * abs(left)))
        if abs(left) <= max(1.0, abs(self.velocity) * dt) and abs(self.velocity) <= 2.0 * slow * dt + 20.0:
            self.belt, self.velocity, self._reached = target, 0.0, True
            return
        self._reached = False
        wanted = math.copysign(allowed, left)
        # Decelerating at up to twice the rate compensates for the discrete time steps.
        faster = abs(wanted) > abs(self.velocity)
        self._ramp(wanted, self.parameters.acceleration if faster else 2.0 * slow, dt)

    def _home(self, dt: float) -> None:
        if self.homing_fails:
            self._ramp(0.0, self.parameters.homing_acceleration, dt)
            self._homing = "error"
            return
        if self.parameters.homing_method == 19:
            active = self.belt >= SWITCH_AT
            speed = self.parameters.homing_speed
            before = self.belt
            self._ramp(-speed if active else speed, self.parameters.homing_acceleration, dt)
            if active == (self.belt >= SWITCH_AT) or before == self.belt:
                return
            self.belt = float(SWITCH_AT)
        elif self.parameters.homing_method != 37:
            self._homing = "error"
            return
        self._offset = self.belt - self.parameters.home_offset
        self.velocity, self._homing, self._reached, self.homed = 0.0, "attained", True, True
