"""SuctionGripper: a vacuum gripper whose valves are connected to the outputs of a robot or I/O block."""

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Iterator
from typing import ClassVar, Final

from arcor2_hw.actions import action, observation
from arcor2_hw.data.device import Health, LossReaction, Reading
from arcor2_hw.exceptions import DeviceError, DeviceFault, NotFound, Refused
from arcor2_hw.keep_alive import once_within
from arcor2_hw.objects import Generic, Robot, Suction
from arcor2_hw.objects.connected import AlarmText, Connected
from arcor2_hw.objects.observing import GoOn
from arcor2_hw.objects.small import PointDirection, PointKind

from .carrier import Carrier
from .settings import VacuumGripperSettings

POLL: Final = 0.01
"""Time between two readings of a sensor that is awaited, s."""
WATCH_PERIOD: Final = 0.05
"""Time between two checks of the carrier and of a gripped part, s."""
BLAST_END_TIMEOUT: Final = 0.4
"""Time for a cancelled action to switch the blast of air off, s."""
NOTHING_HELD: Final = "nothing_held"
PART_LOST: Final = "part_lost"
PART_STICKS: Final = "part_sticks"

log = logging.getLogger(__name__)


class SuctionGripper(Connected, Suction):
    """A vacuum gripper on the outputs of a robot or I/O block."""

    _ABSTRACT = False
    display_name = "Suction gripper"
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"grip": "stop", "release": "stop", "blow_off": "stop"}
    ALARMS: ClassVar = {PART_LOST: AlarmText("The gripped part was lost.", "Find the part, then acknowledge.")}

    def __init__(self, obj_id: str, name: str, settings: VacuumGripperSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._set = settings
        self._carrier = Carrier(name, settings.carrier)
        self._acting = threading.Lock()
        self._part_lock = threading.Lock()
        self._part_expected = False
        self._missing_since: float | None = None
        self.keep_connection(f"{name} on {settings.carrier}")

    def attach(self, find: Callable[[str], Generic]) -> None:
        """Receive the function that finds the carrier."""
        self._carrier.attach(find)

    # -------------------------------------------------------------------------------- connection
    def open_link(self, timeout: float) -> None:
        """Wait until the carrier is connected, and check that it has the points; nothing is switched.

        Raises:
            NotFound: The carrier does not exist.
            InvalidData: The carrier does not have the points.
            DeviceError: NotConnected, ConnectionLost or DeviceTimeout.
        """
        carrier, settings = self._carrier, self._set
        carrier.open(settings.vacuum_output, timeout, lambda: self.observing.stopping)
        carrier.require_holding(settings.vacuum_output)
        if settings.blow_output:
            carrier.require(settings.blow_output, PointDirection.OUTPUT, PointKind.DIGITAL)
        if settings.part_input:
            carrier.require(settings.part_input, PointDirection.INPUT, PointKind.DIGITAL)
        if settings.vacuum_input:
            carrier.require(settings.vacuum_input, PointDirection.INPUT, PointKind.ANALOG)

    def watch(self, stopping: threading.Event) -> None:
        """Watch the carrier, and a gripped part."""
        while not stopping.wait(WATCH_PERIOD):
            self._carrier.check_online()
            with self._part_lock:
                if self._part_expected:
                    self._check_part()

    def disconnect(self) -> None:
        """Stop observing; the vacuum stays as it is."""
        self.stop()
        super().disconnect()
        self._expect_part(False)
        self._carrier.close()

    def condition(self) -> Health:
        """Return check_function after a part was lost."""
        return Health.CHECK_FUNCTION if self._part_lost else Health.NORMAL

    def take_control(self) -> None:
        """Take control of the carrier, whose outputs are used. Raise as the carrier does."""
        self._carrier.take_control()
        self.observing.settled()

    def control_owner(self) -> str | None:
        """Return who has control of the carrier."""
        return self._carrier.control_owner()

    def acknowledge(self, code: str) -> None:
        """Acknowledge that a part was lost. Raise NotFound if this alarm is not active."""
        if code != PART_LOST or not self._part_lost:
            raise NotFound("{gripper} has no alarm {code}.", gripper=self.name, code=code)
        self.set_alarm(PART_LOST, False)

    @property
    def _part_lost(self) -> bool:
        return PART_LOST in self.conditions

    def _carrying_robot(self) -> Robot | None:
        """Return the robot in the settings, otherwise the carrier if it is a robot, otherwise the only robot."""
        carrier = self._carrier.object
        return carrier if isinstance(carrier, Robot) and not self._set.robot else super()._carrying_robot()

    def stop(self) -> None:
        """Cancel the present action and end a blast of air. The vacuum stays as it is, so that no part falls."""
        self.stop_waiting()
        if self._acting.acquire(timeout=BLAST_END_TIMEOUT):  # the cancelled action ends the blast
            self._acting.release()

    # -------------------------------------------------------------------------------- part
    @property
    def senses(self) -> bool:
        """Return whether a sensor detects a gripped part."""
        return bool(self._set.part_input or self._set.vacuum_input)

    @observation
    def part_held(self) -> bool:
        """Return whether a part is held, by the part sensor, the measured vacuum, or the state of the vacuum valve.

        The first one that is available is used.

        Raises:
            DeviceError: NotConnected, ConnectionLost, DeviceTimeout or Stale.
        """
        if self._set.part_input:
            return bool(self._carrier.read(self._set.part_input).value)
        if self._set.vacuum_input:
            return float(self._carrier.read(self._set.vacuum_input).value) >= self._set.part_vacuum
        return bool(self._carrier.read(self._set.vacuum_output).value)

    @observation
    def vacuum(self) -> Reading[float]:
        """Return the vacuum below ambient pressure, Pa. Raise Refused without vacuum_input."""
        if not self._set.vacuum_input:
            raise Refused("{gripper} has no vacuum_input.", gripper=self.name)
        found = self._carrier.read(self._set.vacuum_input)
        return Reading[float](float(found.value), found.stamp, found.monotonic, found.quality)

    def _expect_part(self, expected: bool) -> None:
        """Start or stop monitoring a gripped part."""
        with self._part_lock:
            self._part_expected, self._missing_since = expected, None

    def _check_part(self) -> None:
        """Raise the alarm if the part has been missing for `lost_after` s. Hold `_part_lock`."""
        try:
            held = self.part_held()
        except DeviceError:  # without an answer of the carrier the state of the part is unknown
            held = True
        now = time.monotonic()
        if held:
            self._missing_since = None
        elif self._missing_since is None:
            self._missing_since = now
        if self._missing_since is not None and now - self._missing_since >= self._set.lost_after:
            self._part_expected = False
            self.set_alarm(PART_LOST, True)
            self.detach_part()
            log.warning("%s lost its part", self.name)

    # -------------------------------------------------------------------------------- actions
    @action
    def on(self, *, an: str | None = None) -> None:
        """Switch the vacuum on, without waiting for a part."""
        self._carrier.write(self._set.vacuum_output, True)

    @action
    def off(self, *, an: str | None = None) -> None:
        """Switch the vacuum off, without waiting until the part is released."""
        self._expect_part(False)
        self._carrier.write(self._set.vacuum_output, False)
        self.detach_part()

    @action(deadline=90.0)
    def grip(self, *, an: str | None = None) -> None:
        """Switch the vacuum on and wait until a part is held; without a part switch it off again and fail."""
        with self._act("gripping") as go_on:
            self.set_alarm(PART_LOST, False)
            if self._set.blow_output:
                self._carrier.write(self._set.blow_output, False)
            self._carrier.write(self._set.vacuum_output, True)
            if not self._sensed(True, self._set.grip_time, go_on):
                self._carrier.write(self._set.vacuum_output, False)
                self.detach_part()
                raise DeviceFault(
                    "{gripper} holds nothing.", f"within {self._set.grip_time:g} s", NOTHING_HELD, gripper=self.name
                )
            self.attach_part(hanging=True)
            self._expect_part(self.senses)

    @action(deadline=90.0)
    def release(self, *, an: str | None = None) -> None:
        """Switch the vacuum off, blow the part off, and wait until it is gone; fail if it was lost before."""
        with self._act("releasing") as go_on:
            self._switch_off(go_on)
            if self._part_lost:
                raise DeviceFault("{gripper} lost its part before the release.", "", PART_LOST, gripper=self.name)
            if not self._sensed(False, self._set.release_time, go_on):
                raise DeviceFault("The part sticks to {gripper}.", "", PART_STICKS, gripper=self.name)
            self.detach_part()

    @action(deadline=30.0)
    def blow_off(self, *, an: str | None = None) -> None:
        """Switch the vacuum off and blow the part off."""
        if not self._set.blow_output:
            raise Refused("{gripper} has no blow_output.", gripper=self.name)
        with self._act("blowing off") as go_on:
            self.detach_part()
            self._switch_off(go_on)

    @action(again="safe")
    def is_part_held(self, *, an: str | None = None) -> bool:
        """Return whether a part is held now."""
        return self.part_held()

    @action(again="safe")
    def check_part(self, *, an: str | None = None) -> None:
        """Fail unless the part has been held since it was gripped."""
        if self._part_lost or not self.part_held():
            raise DeviceFault("{gripper} has lost its part.", "", PART_LOST, gripper=self.name)

    @action(again="safe")
    def measure_vacuum(self, *, an: str | None = None) -> float:
        """Measure the vacuum below ambient pressure, Pa."""
        return self.vacuum().value

    @contextlib.contextmanager
    def _act(self, operation: str) -> Iterator[GoOn]:
        """Execute one action at a time.

        The returned check raises Cancelled after a stop, ConnectionLost after a loss.
        """
        if not self._acting.acquire(blocking=False):
            raise Refused("{gripper} is gripping or releasing already. Wait, or stop it.", gripper=self.name)
        try:
            yield self.begin(operation)
        finally:
            self._acting.release()

    def _sensed(self, held: bool, seconds: float, go_on: GoOn) -> bool:
        """Return whether the sensor detects or loses the part within `seconds`. Without a sensor, wait that long."""

        def sensed() -> bool:
            go_on()
            return self.senses and self.part_held() is held

        return once_within(sensed, seconds, POLL) or not self.senses

    def _switch_off(self, go_on: GoOn) -> None:
        """Switch the vacuum off, then blow for `blow_time` s if there is an output for it."""
        self._expect_part(False)
        self._carrier.write(self._set.vacuum_output, False)
        if not self._set.blow_output:
            return
        self._carrier.write(self._set.blow_output, True)
        try:
            once_within(go_on, self._set.blow_time, POLL)
        finally:
            self._carrier.write(self._set.blow_output, False)
