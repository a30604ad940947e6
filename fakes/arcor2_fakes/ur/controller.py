"""The controller: power, safety, running program, registers and I/O, advanced one control cycle at a time."""

import abc
import logging
import math
import time
from collections import deque
from collections.abc import Callable, Generator
from typing import Any

from arcor2_fakes.ur.contact import COLLISION_FORCE, CONTACT_FORCE, Obstacle
from arcor2_fakes.ur.kinematics import Chain
from arcor2_fakes.ur.motion import Arm
from arcor2_fakes.ur.paths import MotionRefused
from arcor2_fakes.ur.states import MAY_MOVE, SAFETY_BITS, JointMode, RobotMode, Runtime, SafetyMode

log = logging.getLogger("controller")

HOME = (0.0, -math.pi / 2, math.pi / 2, -math.pi / 2, -math.pi / 2, 0.0)
UNLOCK_DELAY = 5.0  # s after a protective stop before it may be unlocked
REDUCED_JOINT_SPEED = 1.0  # rad/s
_EMERGENCY_DECELERATION = 24.0  # rad/s^2
_POWER_ON_TIME = 4.0  # s
_BRAKE_RELEASE_TIME = 3.0  # s
_MAX_RECORDS = 200  # number of commands and stops recorded for the truth
Steps = Generator[None, None, None]
"""A running part of a program; each step ends where the real program waits for the next control cycle."""


class Refused(ValueError):
    """The controller refuses a command in its state; the text is the dashboard's answer."""


class Program(abc.ABC):
    """A program that plays on the controller."""

    name = "program"
    register_offset: int | None = None
    """Where ur_rtde's command registers start; None for a program that has none."""

    @abc.abstractmethod
    def run(self) -> Steps:
        """Return the main thread of the program. The program ends with this thread."""

    def ended(self) -> None:  # noqa: B027
        """Handle the end of the program, for any reason."""


class Controller:
    """State shared by the ports, for use in the thread of the event loop only. `tick` is one control cycle."""

    def __init__(self, model: str, version: tuple[int, ...], frequency: float, time_scale: float = 1.0) -> None:
        self.model, self.version, self.frequency = model, version, frequency
        self.period = 1.0 / frequency
        self.chain = Chain(model)
        self.arm = Arm(self.chain, HOME)
        self.time_scale = time_scale
        self.cycles = 0
        self.watched = 0
        """Control cycles that the watchdog counts: not those that the fake missed and catches up."""
        self.robot_mode = RobotMode.RUNNING
        self.safety = SafetyMode.NORMAL
        self.runtime = Runtime.STOPPED
        self.remote = True
        self.operational_mode = "AUTOMATIC"
        self.program: Program | None = None
        self.loaded: str | None = None
        self.load_program: Callable[[str], Program] | None = None
        self.freedrive = self.contact = False
        self.obstacle: Obstacle | None = None
        self.tcp_force: tuple[float, ...] = (0.0,) * 6
        self.payload, self.payload_cog, self.payload_inertia = 0.0, (0.0, 0.0, 0.0), (0.0,) * 6
        self.tcp_offset: tuple[float, ...] = (0.0,) * 6
        self.input_ints, self.input_doubles = [0] * 48, [0.0] * 48
        self.output_ints, self.output_doubles = [0] * 48, [0.0] * 48
        self.input_bits, self.output_bits = 0, 0  # 128 bits each
        self.digital_inputs, self.digital_outputs = 0, 0  # 0-7 standard, 8-15 configurable, 16-17 tool
        self.analog_outputs = [0.0, 0.0]
        self.commands: deque[dict[str, Any]] = deque(maxlen=_MAX_RECORDS)
        self.stops: deque[dict[str, Any]] = deque(maxlen=_MAX_RECORDS)
        self.stops_seen = 0
        self.watchdog_trips = self.programs_killed = 0
        self.changed: Callable[[], None] = lambda: None
        self.failed: Callable[[str], None] = lambda _: None  # called with the run-time error of a program
        self._steps: Steps | None = None
        self._conditions: dict[SafetyMode, bool] = dict.fromkeys(SafetyMode, False)
        self._unlockable = 0  # cycle from which a protective stop may be unlocked
        self._resumes = False  # a safeguard stop holds the program, which then continues by itself
        self._suspended = False  # held without reporting it
        self._watchdog: tuple[int, float] | None = None  # input register and timeout, s
        self._written = [0] * 48  # `watched` at the last write of each integer register
        self._due: list[tuple[int, Callable[[], None]]] = []  # (cycle, function)

    # ------------------------------------------------------------------------------------------------ control cycle
    def tick(self, late: bool = False) -> None:
        """Run one control cycle. If it is `late`, the watchdog does not count it."""
        self.cycles += 1
        self.watched += not late
        if self._due:
            self._run_due()
        if self._watchdog is not None:
            self._check_watchdog()
        runtime = self.runtime
        if runtime is Runtime.PLAYING and self._steps is not None and not self._suspended:
            try:
                next(self._steps)
            except StopIteration:
                self.stop_program("ended")
            except MotionRefused as e:
                self.protective_stop(str(e))
            except (ValueError, TypeError, LookupError, ArithmeticError) as e:  # the program is invalid
                self.stop_program(f"runtime error: {e}")
                self.failed(str(e))
        elif runtime is Runtime.STOPPING and not self.arm.busy:
            self.runtime = Runtime.STOPPED
        elif runtime is Runtime.PAUSING and not self.arm.moving:
            self.runtime = Runtime.PAUSED
        elif runtime is Runtime.RESUMING:
            self.runtime = Runtime.PLAYING
        if self.arm.motion is not None:
            try:
                self.arm.step(self.period)
            except MotionRefused as e:
                self.arm.halt()
                self.protective_stop(str(e))
        elif self.arm.rate != (0.0 if self.arm.held else self.arm.slider):
            self.arm.step(self.period)
        if self.obstacle is not None:
            self._touch(self.obstacle)

    def _touch(self, obstacle: Obstacle) -> None:
        force = obstacle.force(self.arm.pose)
        self.tcp_force = (*force, 0.0, 0.0, 0.0)
        if math.hypot(*force) > COLLISION_FORCE and self.safety in MAY_MOVE and self.arm.moving:
            self.arm.halt(_EMERGENCY_DECELERATION)
            self.protective_stop("the tool has run into something")

    @property
    def touching(self) -> bool:
        """Return whether the tool counts as in contact."""
        return self.contact or math.hypot(*self.tcp_force[:3]) > CONTACT_FORCE

    def place_obstacle(self, obstacle: Obstacle | None) -> None:
        """Set or remove the obstacle."""
        self.obstacle, self.tcp_force = obstacle, (0.0,) * 6

    def after(self, seconds: float, do: Callable[[], None]) -> None:
        """Call a function later, by the controller's time and `time_scale`."""
        self._due.append((self.cycles + max(1, round(seconds * self.time_scale * self.frequency)), do))

    def _run_due(self) -> None:
        due = [do for cycle, do in self._due if cycle <= self.cycles]
        if due:
            self._due = [entry for entry in self._due if entry[0] > self.cycles]
            for do in due:
                do()
            self.changed()

    # -------------------------------------------------------------------------------------------------------- safety
    @property
    def safety_bits(self) -> int:
        """Return RTDE safety_status_bits."""
        return SAFETY_BITS[self.safety]

    @property
    def robot_bits(self) -> int:
        """Return RTDE robot_status_bits: power on, program running, teach button."""
        powered = self.robot_mode >= RobotMode.POWER_ON
        return int(powered) | int(self.program is not None) << 1 | int(self.freedrive) << 2

    @property
    def joint_mode(self) -> JointMode:
        """Return RTDE joint_mode, the same for all joints."""
        if self.safety is SafetyMode.FAULT:
            return JointMode.FAULT
        if self.safety is SafetyMode.VIOLATION:
            return JointMode.VIOLATION
        if self.robot_mode is RobotMode.RUNNING:
            return JointMode.BACKDRIVE if self.freedrive else JointMode.RUNNING
        return JointMode.IDLE if self.robot_mode is RobotMode.IDLE else JointMode.POWER_OFF

    def _condition(self, mode: SafetyMode, on: bool) -> None:
        self._conditions[mode] = on
        # The worst state prevails, that is the highest number, but recovery does not hide a protective stop.
        rank = [m for m in SafetyMode if self._conditions[m]]
        if self._conditions[SafetyMode.PROTECTIVE_STOP] and SafetyMode.RECOVERY in rank:
            rank.remove(SafetyMode.RECOVERY)
        before, self.safety = self.safety, max(rank, default=SafetyMode.NORMAL)
        self.arm.speed_limit = REDUCED_JOINT_SPEED if self._conditions[SafetyMode.REDUCED] else math.pi
        if self.safety is not before:
            log.info("safety %s", self.safety.name)
        self.changed()

    def protective_stop(self, reason: str) -> None:
        """Stop on the path, and pause the program until a person unlocks it."""
        log.info("protective stop: %s", reason)
        self._unlockable = self.cycles + round(UNLOCK_DELAY * self.time_scale * self.frequency)
        self._pause(protective=True)
        self._resumes = False
        self._condition(SafetyMode.PROTECTIVE_STOP, True)

    def unlock_protective_stop(self) -> None:
        """Unlock the protective stop. Raise `Refused` in the first seconds; the program stays paused."""
        if not self._conditions[SafetyMode.PROTECTIVE_STOP]:
            return
        if self.cycles < self._unlockable:
            raise Refused(
                "Cannot unlock protective stop until 5s after occurrence. "
                "Always inspect cause of protective stop before unlocking"
            )
        self._condition(SafetyMode.PROTECTIVE_STOP, False)

    def safeguard_stop(self, on: bool, reports_paused: bool = False) -> None:
        """Open or close the door. An open door holds a playing program, which continues when it closes.

        RTDE reports "playing" by default, because ur_rtde waits through a safeguard stop, but fails at once when
        "paused" is reported; `reports_paused` selects the other interpretation of the manual.
        """
        if on and not self._conditions[SafetyMode.SAFEGUARD_STOP]:
            self._resumes = self.runtime in (Runtime.PLAYING, Runtime.RESUMING)
            if reports_paused or not self._resumes:
                self._pause()
            else:
                self._suspended = True
                self.arm.hold()
        self._condition(SafetyMode.SAFEGUARD_STOP, on)
        if not on and self._resumes and self.safety in MAY_MOVE:
            self._resume()
        if not on and self.program is None and self.safety in MAY_MOVE:
            self.arm.go_on()

    def emergency_stop(self, on: bool, system: bool = False) -> None:
        """Press or release the emergency stop. It ends the program; the arm loses power at standstill."""
        mode = SafetyMode.SYSTEM_EMERGENCY_STOP if system else SafetyMode.ROBOT_EMERGENCY_STOP
        if on:
            self._cut(mode)
        else:
            for each in (SafetyMode.SYSTEM_EMERGENCY_STOP, SafetyMode.ROBOT_EMERGENCY_STOP):
                self._condition(each, False)

    def fault(self, violation: bool) -> None:
        """Enter a violation of a safety limit, or a fault, until `restart_safety`."""
        self._cut(SafetyMode.VIOLATION if violation else SafetyMode.FAULT)

    def reduced(self, on: bool) -> None:
        """Reduce the limits from the next motion on."""
        self._condition(SafetyMode.REDUCED, on)

    def recovery(self, on: bool) -> None:
        """Enter recovery mode: no program runs, and a person moves the arm back within its limits."""
        self.stop_program("recovery")
        self._condition(SafetyMode.RECOVERY, on)

    def restart_safety(self) -> None:
        """Clear violation and fault; the arm has no power afterwards."""
        for mode in (SafetyMode.VIOLATION, SafetyMode.FAULT, SafetyMode.PROTECTIVE_STOP):
            self._condition(mode, False)
        self.power_off()

    def _cut(self, mode: SafetyMode) -> None:
        self.stop_program(mode.name)
        self.arm.halt(_EMERGENCY_DECELERATION)
        self._condition(mode, True)
        if self.robot_mode >= RobotMode.POWER_ON:
            self._when_still(self.power_off)

    def _when_still(self, do: Callable[[], None]) -> None:
        if self.arm.moving:
            self._due.append((self.cycles + 1, lambda: self._when_still(do)))
        else:
            do()

    # --------------------------------------------------------------------------------------------------------- power
    def power_on(self) -> None:
        """Switch from off to idle, brakes closed. Raise `Refused` in an emergency stop or fault."""
        if self.safety >= SafetyMode.SYSTEM_EMERGENCY_STOP:
            raise Refused(f"Command is not allowed in safety mode {self.safety.name}")
        if self.robot_mode is RobotMode.POWER_OFF:
            self._mode(RobotMode.POWER_ON)
            self.after(_POWER_ON_TIME, lambda: self._mode_from(RobotMode.POWER_ON, RobotMode.IDLE))

    def power_off(self) -> None:
        """End the program, close the brakes and switch power off."""
        self.stop_program("power off")
        self.arm.teleport(self.arm.q)
        self.freedrive = False
        self._mode(RobotMode.POWER_OFF)

    def brake_release(self) -> None:
        """Release the brakes; from off, switch power on first. Raise `Refused`."""
        self.power_on()
        if self.robot_mode is RobotMode.POWER_ON:
            self.after(_POWER_ON_TIME + _BRAKE_RELEASE_TIME, lambda: self._mode_from(RobotMode.IDLE, RobotMode.RUNNING))
        elif self.robot_mode is RobotMode.IDLE:
            self.after(_BRAKE_RELEASE_TIME, lambda: self._mode_from(RobotMode.IDLE, RobotMode.RUNNING))

    def boot(self) -> None:
        """Switch the controller on: booting, then off."""
        self.power_off()
        self._mode(RobotMode.BOOTING)
        self.after(_POWER_ON_TIME, lambda: self._mode_from(RobotMode.BOOTING, RobotMode.POWER_OFF))

    def _mode(self, mode: RobotMode) -> None:
        self.robot_mode = mode
        self.changed()

    def _mode_from(self, expected: RobotMode, mode: RobotMode) -> None:
        if self.robot_mode is expected:  # otherwise the state has changed in the meantime
            self._mode(mode)

    # ------------------------------------------------------------------------------------------------------- program
    def start_program(self, program: Program) -> None:
        """Replace the running program. Raise `Refused` if the arm cannot move."""
        if self.robot_mode is not RobotMode.RUNNING or self.safety not in MAY_MOVE:
            raise Refused(f"Command is not allowed: {self.robot_mode.name}, {self.safety.name}")
        self.stop_program("replaced")
        self.program, self._steps = program, program.run()
        self.runtime = Runtime.PLAYING
        self.arm.go_on()
        log.info("program %s plays", program.name)
        self.changed()

    def stop_program(self, reason: str) -> None:
        """End the program, if there is one; the arm decelerates."""
        if self.program is None:
            return
        log.info("program %s: %s", self.program.name, reason)
        if reason != "ended":
            self.programs_killed += 1
        program, steps = self.program, self._steps
        self.program, self._steps, self._watchdog = None, None, None
        self._resumes = self._suspended = self.freedrive = False
        self.arm.halt()
        if self.safety in MAY_MOVE:
            self.arm.go_on()
        self.runtime = Runtime.STOPPING
        if steps is not None:
            steps.close()
        program.ended()
        self.changed()

    def pause_program(self) -> None:
        """Pause on the path. Raise `Refused` if no program plays."""
        if self.runtime is not Runtime.PLAYING:
            raise Refused("Failed to execute: pause")
        self._resumes = False
        self._pause()

    def play_program(self) -> None:
        """Continue a paused program, or start the loaded one. Raise `Refused`."""
        if self.robot_mode is not RobotMode.RUNNING or self.safety not in MAY_MOVE:
            raise Refused("Failed to execute: play")
        if self.runtime in (Runtime.PAUSED, Runtime.PAUSING):
            self._resume()
        elif self.program is None and self.loaded is not None and self.load_program is not None:
            self.start_program(self.load_program(self.loaded))
        elif self.program is None:
            raise Refused("Failed to execute: play")

    def _pause(self, protective: bool = False) -> None:
        self._suspended = False
        self.arm.hold(protective)
        if self.runtime in (Runtime.PLAYING, Runtime.RESUMING):
            self.runtime = Runtime.PAUSING

    def _resume(self) -> None:
        self._resumes = self._suspended = False
        self.arm.go_on()
        if self.runtime in (Runtime.PAUSED, Runtime.PAUSING):
            self.runtime = Runtime.RESUMING
        self.changed()

    # ---------------------------------------------------------------------------------------------------- watchdog
    def integer_written(self, index: int) -> None:
        """Handle a write of an integer input register by an RTDE client."""
        self._written[index] = self.watched

    def set_watchdog(self, register: int, minimum_frequency: float) -> None:
        """Set the watchdog: stop the program if the register is written at a lower rate, Hz; 0 disarms it."""
        self._watchdog = (register, 1.0 / minimum_frequency) if minimum_frequency > 0.0 else None
        self._written[register] = self.watched

    @property
    def watchdog(self) -> float | None:
        """Return the timeout of the watchdog, s; None when it is not armed."""
        return None if self._watchdog is None else self._watchdog[1]

    def _check_watchdog(self) -> None:
        assert self._watchdog is not None
        register, silence = self._watchdog
        if (self.watched - self._written[register]) * self.period > silence:
            self.watchdog_trips += 1
            self.stop_program("watchdog")

    # --------------------------------------------------------------------------------------------------- reports
    def note_command(self, kind: str, **details: Any) -> None:
        """Record a motion command for the truth."""
        self.commands.append({"t": time.monotonic(), "kind": kind, **details})

    def note_stop(self, via: str, code: int | str) -> None:
        """Record a frame that requests a stop, at its arrival."""
        self.stops_seen += 1
        self.stops.append({"t": time.monotonic(), "via": via, "code": code})
