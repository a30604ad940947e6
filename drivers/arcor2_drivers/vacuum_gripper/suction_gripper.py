"""SuctionGripper: a vacuum gripper whose valves hang on the outputs of a robot or of an I/O block."""

import logging
import threading
import time
from collections.abc import Callable
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.data.device import Alarm, Connection, Health, LossReaction, Reading, Severity
from arcor2_hw.exceptions import Arcor2Error, Cancelled, DeviceError, DeviceFault, NotFound, Refused
from arcor2_hw.objects import Generic, Robot, Suction
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.small import PointDirection, PointKind

from .carrier import Carrier
from .settings import VacuumGripperSettings

POLL: Final = 0.01
WATCH_PERIOD: Final = 0.05
"""Seconds between two looks at a part that is held."""
JOIN: Final = 0.4
NOTHING_HELD: Final = "nothing_held"
PART_LOST: Final = "part_lost"
PART_STICKS: Final = "part_sticks"

log = logging.getLogger(__name__)


class SuctionGripper(Suction):
    """A vacuum gripper on the outputs of a robot or of an I/O block."""

    _ABSTRACT = False
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"grip": "stop", "release": "stop", "blow_off": "stop"}

    def __init__(self, obj_id: str, name: str, settings: VacuumGripperSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._set = settings
        self._carrier = Carrier(name, settings.carrier)
        self._failed = False
        self._was_back = False
        self._stops = 0
        self._work = threading.Lock()
        self._leaving = threading.Event()
        self._watch: threading.Thread | None = None
        self._lost_since: Timestamp | None = None

    def attach(self, find: Callable[[str], Generic]) -> None:
        """Take the way to the carrier."""
        self._carrier.attach(find)

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Wait until the carrier is connected, and look that it has the points; nothing is switched.

        Raises NotFound or InvalidData for a carrier or point that is not there, NotConnected, ConnectionLost,
        DeviceTimeout.
        """
        if self.connection is Connection.ONLINE:
            return
        self._failed = True
        try:
            self._carrier.connect(timeout, self._check_points)
        except Arcor2Error:
            self._carrier.disconnect()
            raise
        self._failed = False
        self._was_back = self._carrier.connection is Connection.BACK

    def _check_points(self) -> None:
        carrier, chosen = self._carrier, self._set
        carrier.require_holding(chosen.vacuum_output)
        if chosen.blow_output:
            carrier.require(chosen.blow_output, PointDirection.OUTPUT, PointKind.DIGITAL)
        if chosen.part_input:
            carrier.require(chosen.part_input, PointDirection.INPUT, PointKind.DIGITAL)
        if chosen.vacuum_input:
            carrier.require(chosen.vacuum_input, PointDirection.INPUT, PointKind.ANALOG)
        carrier.read(chosen.vacuum_output)

    def disconnect(self) -> None:
        """Let go of the carrier; the vacuum stays as it is."""
        self.stop()
        self._end_watch()
        self._failed = False
        self._carrier.disconnect()

    @property
    def connection(self) -> Connection:
        """Return the state of the carrier's connection."""
        state = self._carrier.connection
        if state is Connection.OFFLINE and self._failed:
            return Connection.FAILED
        if state is Connection.BACK and self._was_back:  # it was lost before we came
            return Connection.ONLINE
        self._was_back = False
        return state

    @property
    def connection_reason(self) -> str:
        """Return why the carrier's connection is lost."""
        return self._carrier.reason()

    @property
    def health(self) -> Health:
        """Tell of a part that was lost, and of a carrier that does not answer."""
        if self.connection in (Connection.LOST, Connection.FAILED):
            return Health.FAILURE
        return Health.NORMAL if self._lost_since is None else Health.CHECK_FUNCTION

    def take_control(self) -> None:
        """Take control of the carrier: the outputs are its own. Raises as the carrier does."""
        self._carrier.take_control()

    def control_owner(self) -> str | None:
        """Return who has control of the carrier."""
        return self._carrier.control_owner()

    # -------------------------------------------------------------------------------- alarms
    def alarms(self) -> list[Alarm]:
        """Return the alarm of a part that was lost while it was held; it stands until it is acknowledged."""
        since = self._lost_since
        if since is None:
            return []
        text, remedy = f"{self.name} lost its part", "look where the part is, then acknowledge"
        return [Alarm(PART_LOST, Severity.ERROR, text, remedy, since)]

    def acknowledge(self, code: str) -> None:
        """Acknowledge that a part was lost; NotFound when no such alarm stands."""
        if code != PART_LOST or self._lost_since is None:
            raise NotFound("{name} has no alarm {code}", name=self.name, code=code)
        self._lost_since = None

    def _carrying_robot(self) -> Robot | None:
        """Return the robot that the settings name, else the carrier when that is a robot, else the only robot."""
        carrier = self._carrier.object
        return carrier if isinstance(carrier, Robot) and not self._set.robot else super()._carrying_robot()

    def stop(self) -> None:
        """End what waits here with Cancelled, and a blast of air. The vacuum stays as it is: no part falls."""
        self._stops += 1
        if self._work.acquire(timeout=JOIN):  # the blast is ended by who began it
            self._work.release()

    # -------------------------------------------------------------------------------- the part
    @property
    def senses(self) -> bool:
        """Return whether something tells of a held part."""
        return bool(self._set.part_input or self._set.vacuum_input)

    def part_held(self) -> bool:
        """Return whether a part is held: by the sensor, by the vacuum, or, without either, by whether the vacuum is on.

        Raises NotConnected, ConnectionLost, DeviceTimeout, Stale.
        """
        if self._set.part_input:
            return bool(self._carrier.read(self._set.part_input).value)
        if self._set.vacuum_input:
            return float(self._carrier.read(self._set.vacuum_input).value) >= self._set.part_vacuum
        return bool(self._carrier.read(self._set.vacuum_output).value)

    def vacuum(self) -> Reading[float]:
        """Return the vacuum below the surrounding pressure, Pa. Refused without vacuum_input."""
        if not self._set.vacuum_input:
            raise Refused("{name} has no vacuum_input", name=self.name)
        found = self._carrier.read(self._set.vacuum_input)
        return Reading[float](float(found.value), found.stamp, found.monotonic, found.quality)

    # -------------------------------------------------------------------------------- actions
    @action
    def on(self, *, an: str | None = None) -> None:
        """Switch the vacuum on, and do not wait."""
        self._carrier.write(self._set.vacuum_output, True)

    @action
    def off(self, *, an: str | None = None) -> None:
        """Switch the vacuum off, and do not wait."""
        self._end_watch()
        self._carrier.write(self._set.vacuum_output, False)
        self.detach_part()

    @action(deadline=90.0)
    def grip(self, *, an: str | None = None) -> None:
        """Switch the vacuum on and wait until a part is held; with nothing held it is switched off again."""
        with _Turn(self) as stops:
            self._lost_since = None
            if self._set.blow_output:
                self._carrier.write(self._set.blow_output, False)
            self._carrier.write(self._set.vacuum_output, True)
            if not self._sensed(True, self._set.grip_time, stops):
                self._carrier.write(self._set.vacuum_output, False)
                self.detach_part()
                raise DeviceFault(
                    "{name} holds nothing", f"within {self._set.grip_time:g} s", NOTHING_HELD, name=self.name
                )
            self.attach_part(hanging=True)
            if self.senses:
                self._begin_watch()

    @action(deadline=90.0)
    def release(self, *, an: str | None = None) -> None:
        """Switch the vacuum off, blow the part off, and wait until it is gone; an error when it was lost before."""
        with _Turn(self) as stops:
            self._end_watch()
            lost = self._lost_since is not None
            self._carrier.write(self._set.vacuum_output, False)
            if self._set.blow_output:
                self._blow(stops)
            if lost:
                raise DeviceFault("{name} had lost its part before it was let go", fault_code=PART_LOST, name=self.name)
            if not self._sensed(False, self._set.release_time, stops):
                raise DeviceFault("the part sticks to {name}", fault_code=PART_STICKS, name=self.name)
            self.detach_part()

    @action(deadline=30.0)
    def blow_off(self, *, an: str | None = None) -> None:
        """Push the part off with a blast of air; the vacuum is switched off before."""
        if not self._set.blow_output:
            raise Refused("{name} has no blow_output", name=self.name)
        with _Turn(self) as stops:
            self._end_watch()
            self._carrier.write(self._set.vacuum_output, False)
            self.detach_part()
            self._blow(stops)

    @action
    def is_part_held(self, *, an: str | None = None) -> bool:
        """Return whether a part is held now."""
        return self.part_held()

    @action
    def check_part(self, *, an: str | None = None) -> None:
        """Go on only when the part is held, and was all the time since it was gripped."""
        if self._lost_since is not None or not self.part_held():
            raise DeviceFault("{name} has lost its part", fault_code=PART_LOST, name=self.name)

    @action
    def measure_vacuum(self, *, an: str | None = None) -> float:
        """Measure the vacuum below the surrounding pressure, Pa."""
        return self.vacuum().value

    # -------------------------------------------------------------------------------- inside
    def _check(self, stops: int) -> None:
        if self._stops != stops:
            raise Cancelled("the work of {name} was stopped", name=self.name)
        self._carrier.require_up()

    def _sensed(self, held: bool, seconds: float, stops: int) -> bool:
        """Wait for what the sensor says; without a sensor for the time it takes. Raises Cancelled."""
        until = time.monotonic() + seconds
        while True:
            self._check(stops)
            if self.senses and self.part_held() is held:
                return True
            if time.monotonic() >= until:
                return not self.senses
            time.sleep(POLL)

    def _blow(self, stops: int) -> None:
        self._carrier.write(self._set.blow_output, True)
        try:
            until = time.monotonic() + self._set.blow_time
            while time.monotonic() < until:
                self._check(stops)
                time.sleep(POLL)
        finally:
            self._carrier.write(self._set.blow_output, False)

    def _begin_watch(self) -> None:
        self._end_watch()
        self._leaving = leaving = threading.Event()
        self._watch = threading.Thread(target=self._watching, args=(leaving,), name=f"part of {self.name}", daemon=True)
        self._watch.start()

    def _end_watch(self) -> None:
        self._leaving.set()
        watch, self._watch = self._watch, None
        if watch is not None:
            watch.join(JOIN)

    def _watching(self, leaving: threading.Event) -> None:
        """Look at the part until it is let go; a carrier that does not answer tells nothing of it."""
        missing = 0.0
        while not leaving.wait(WATCH_PERIOD):
            try:
                held = self.part_held()
            except DeviceError:
                missing = 0.0
                continue
            moment = time.monotonic()
            if held:
                missing = 0.0
            elif missing == 0.0:
                missing = moment
            if not held and moment - missing >= self._set.lost_after:
                self._lost_since = now()
                self.detach_part()
                log.warning("%s lost its part", self.name)
                return


class _Turn:
    """One act at a time; gives the count of stops when it began."""

    def __init__(self, gripper: SuctionGripper) -> None:
        self._gripper = gripper

    def __enter__(self) -> int:
        if not self._gripper._work.acquire(blocking=False):
            raise Refused("{name} is gripping or releasing already", name=self._gripper.name)
        return self._gripper._stops

    def __exit__(self, *_: object) -> None:
        self._gripper._work.release()
