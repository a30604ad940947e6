"""Control: taking and releasing control of the arm, stopping it, and driving the conveyor belt."""

import contextlib
import math
import threading
from typing import Final

from arcor2_hw.exceptions import DeviceError, DeviceTimeout, NotInControl, OutOfRange, Refused
from arcor2_hw.messages import Phrase
from arcor2_hw.objects.arm import StopCounter

from .frames import Command
from .observer import Observer
from .settings import DobotMagicianSettings

STANDSTILL_SEEN_TIMEOUT: Final = 1.0
"""Time limit for the observer to detect that the arm has stopped, s: 0.1 s, more on a busy computer."""
STANDSTILL_TIMEOUT: Final = 2.0
"""Time after which a stopped arm must be at standstill, s."""


class Control:
    """Control of the arm. `commands` is a lock for sending several commands without interruption."""

    def __init__(self, observer: Observer, settings: DobotMagicianSettings, motion_lock: threading.Lock) -> None:
        self._observer, self._settings, self._motion_lock = observer, settings, motion_lock
        self.who = observer.who
        self.commands = threading.Lock()
        self.stops = StopCounter()
        self.ours = False
        self._belt_runs = False
        self._left_running = False

    @property
    def _active(self) -> bool:
        """Return whether arm or belt move on our command."""
        return self.ours and (self._motion_lock.locked() or self._belt_runs)

    def take(self) -> None:
        """Take control of an arm at standstill, unless we have it: clear its queue, set tool and speeds.

        A motion of another client is not interrupted. Commands in a queue that is not running are dropped, because they
        would run with our first motion.

        Raises:
            NotInControl: The arm moves.
            Refused: The arm did not accept a value.
        """
        if self.ours:
            return
        try:  # an arm counts as moving for a moment after it has stopped
            self._observer.wait(lambda sample: not sample.moving, STANDSTILL_SEEN_TIMEOUT, "standstill")
        except DeviceTimeout as e:
            raise NotInControl(
                "{device} is being moved by another client. Wait until it stops.", device=self.who
            ) from e
        has = self._settings
        joint, ramp = math.degrees(has.max_joint_speed), math.degrees(has.joint_acceleration)
        tcp, tcp_ramp = has.max_tcp_speed * 1000.0, has.tcp_acceleration * 1000.0
        with self.commands:
            self._clear_queue()
            self._set(Command.END_EFFECTOR, "3f", has.tool_x * 1000.0, 0.0, has.tool_z * 1000.0)
            self._set(Command.PTP_JOINT, "8f", *[joint] * 4, *[ramp] * 4)
            self._set(Command.PTP_COORDINATE, "4f", tcp, joint, tcp_ramp, ramp)
            self._set(Command.PTP_JUMP, "2f", has.jump_height * 1000.0, has.jump_limit * 1000.0)
            self.ours = True
            self._left_running = False
            self._observer.observing.check()
        self._observer.observing.settled()

    def release(self) -> None:
        """Stop arm and belt, and release control, if we have it."""
        if self._active:
            self.stop()
        self.drop()

    def drop(self) -> None:
        """Record that control has ended, without sending anything."""
        self._left_running = self._left_running or self._active
        self.ours = False

    def leave(self) -> None:
        """Stop arm and belt before disconnecting, because the arm itself would not stop them."""
        if self._active:
            self.stops.request()
            with contextlib.suppress(DeviceError):  # it cannot be reached
                self.send_stop()
        self.drop()
        self._left_running = False

    def owner(self) -> str | None:
        """Return "us", "another client" while the arm moves without us, or None."""
        if self.ours:
            return "us"
        newest = self._observer.newest()
        moving = newest is not None and self._observer.observing.online and newest.moving
        return Phrase.of("another client") if moving else None

    def require(self) -> None:
        """Raise NotInControl unless we have control, or why the arm is not observed."""
        self._observer.observing.check()
        if not self.ours:
            raise NotInControl("{device}: control is not taken.", device=self.who)

    def _set(self, command: Command, layout: str, *values: float) -> None:
        """Set values and read them back. Raise Refused."""
        self._observer.set(command, layout, *values)
        actual = self._observer.get(command, layout)
        if any(abs(a - b) > 1e-3 * max(1.0, abs(b)) for a, b in zip(actual, values, strict=True)):
            raise Refused(
                "{device} did not accept {name}.",
                f"sent {values}, read {actual}",
                device=self.who,
                name=command.name.lower(),
            )

    # -------------------------------------------------------------------------------- stopping
    def stop(self) -> None:
        """Stop arm and belt, even if they still run since a connection loss, and wait for standstill of the arm.

        Raises:
            NotInControl: The arm is moved by another client.
            DeviceTimeout: The arm does not stop.
            ConnectionLost: The stop cannot be sent.
        """
        self.stops.request()
        self._observer.wake()
        if not self.ours and not self._left_running:
            if self.owner() is not None:
                raise NotInControl("{device} is being moved by another client; control is not taken.", device=self.who)
            return
        self._observer.observing.check()
        self.send_stop()
        self.wait_rest()
        self._left_running = False

    def send_stop(self) -> None:
        """Stop at once, and clear the queue, so that the next start does not run it."""
        with self.commands:
            self._clear_queue()
            if self._belt_runs:
                self.drive_belt(0.0)

    def _clear_queue(self) -> None:
        self._observer.set(Command.QUEUE_FORCE_STOP)
        self._observer.set(Command.QUEUE_CLEAR)

    def wait_rest(self) -> None:
        """Wait for standstill. Raise DeviceTimeout."""
        self._observer.wait(lambda sample: not sample.moving, STANDSTILL_TIMEOUT, "standstill after a stop")

    def drive_belt(self, speed: float) -> None:
        """Drive the conveyor belt, m/s. Hold `commands`."""
        if self._settings.conveyor_port < 0:
            raise Refused("{device} has no conveyor: conveyor_port is not set.", device=self.who)
        pulses = round(speed * self._settings.conveyor_pulses)
        if abs(pulses) >= 1 << 31:
            raise OutOfRange(
                "speed must be lower, not {speed!r}: the stepper has 32 bits of pulses per second.", speed=speed
            )
        self._observer.set(Command.STEPPER, "BBi", self._settings.conveyor_port, int(pulses != 0), pulses)
        self._belt_runs = pulses != 0
