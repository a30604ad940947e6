"""Block: state, watchdog, points and pulses of a remote I/O block. A mixin of both object types."""

import contextlib
import random
import threading
import time
from collections.abc import Mapping
from typing import ClassVar, Final

from arcor2_hw.data.device import Alarm, LossReaction, Reading, Severity
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, Refused
from arcor2_hw.messages import Message, Phrase, translatable
from arcor2_hw.objects.connected import AlarmText
from arcor2_hw.objects.edges import DigitalPoints
from arcor2_hw.objects.modbus_device import ModbusDevice
from arcor2_hw.objects.modbus_link import ModbusLink
from arcor2_hw.objects.polled_control import OWNED_BY_US
from arcor2_hw.objects.settings import within
from arcor2_hw.objects.state_observer import Snapshot

from . import registers
from .points import Point, arming
from .registers import Image, WatchdogState
from .settings import MAX_WATCHDOG_TIMEOUT, BlockSettings

WATCHDOG: Final = "watchdog"
"""Code of the fault of an expired watchdog."""
REFUSALS: Final = translatable({4: "an expired watchdog holds the output"})
"""Meanings of Modbus exceptions that are specific to this block."""


class Block(ModbusDevice[Image]):
    """A block that is read every 20 ms. While we have control, each reading also triggers its watchdog if it is due."""

    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(MAX_WATCHDOG_TIMEOUT / 1000.0)
    ALARMS: ClassVar[Mapping[str, AlarmText]] = {
        "supply_missing": AlarmText("the supply of the outputs is missing", "check fuse and cable of the outputs"),
        "overload": AlarmText("an output is overloaded", "check the loads at the outputs for a short circuit"),
        WATCHDOG: AlarmText(
            "this computer was too slow for its watchdog; the outputs are in their safe state",
            "take control again",
            Severity.WARNING,
        ),
    }
    period = busy_period = 0.02

    def use_block(self, settings: BlockSettings, points: Mapping[str, Point]) -> None:
        """Prepare the connection; called in `__init__`."""
        self._s, self.block_points = settings, points
        self.link = ModbusLink.of(self.name, settings, exceptions=REFUSALS)
        # Two readings, each repeated once after draining the line.
        self.answers_within = 6.0 * settings.request_timeout
        self.use_link(self.link)
        self.digital_points = DigitalPoints(point.io for point in points.values())
        self._watchdog = registers.WATCHDOG + registers.WATCHDOG_SIZE * settings.watchdog
        self._number = random.randint(1, 0xFFFF)  # distinguishes our watchdog from another host's
        self._one_pulse = threading.Lock()
        self._pulsing: set[int] = set()
        self._triggered = 0.0

    # -------------------------------------------------------------------------------- state
    def open_link(self, timeout: float) -> Snapshot[Image]:
        """Open the connection and forget the values of the points."""
        self.digital_points.forget()
        return super().open_link(timeout)

    def read_state(self) -> Image:
        """Read the process image."""
        return registers.decode(self.link.read_input_registers(0, registers.IMAGE_COUNT))

    def on_state(self, snapshot: Snapshot[Image]) -> None:
        """Debounce the digital points, and set the alarms of the diagnosis bits."""
        for bit, code in registers.DIAGNOSES.items():
            self.set_alarm(code, bool(snapshot.value.diagnosis & bit))
        for name in self.digital_points.names:
            point = self.block_points[name]
            self.digital_points.take(name, snapshot.value.digital(point.kind, point.channel), snapshot.asked)

    def after_reading(self) -> None:
        """Notify listeners of edges, and trigger the watchdog."""
        self.digital_points.notify_edges()
        if self.in_control and time.monotonic() - self._triggered >= self._s.watchdog_ms / 5000.0:
            self.repeat_once(lambda: self.link.write_registers(self._watchdog + registers.TRIGGER, self._number))
            self._triggered = time.monotonic()

    def alarms(self) -> list[Alarm]:
        """Return the alarms of the present diagnosis."""
        self.fresh()
        return super().alarms()

    # -------------------------------------------------------------------------------- control
    def arm(self) -> None:
        """Start the watchdog with the safe state of each output, and check that it runs. No output is written.

        Raises:
            DeviceFault: The watchdog does not run, so nothing may be switched on.
            Refused: The block did not store the settings of the watchdog.
        """
        armed = arming(self.block_points.values(), self._s.watchdog_ms, self._number)
        self.link.write_registers(self._watchdog + registers.COMMAND, registers.ACKNOWLEDGE)
        self.link.write_verified(self._watchdog, *armed)
        self.set_alarm(WATCHDOG, False)
        self._triggered = time.monotonic()
        if problem := self.why_control_ended(self.snapshot().value):
            with contextlib.suppress(DeviceError):
                self.disarm()
            self.drop_control(problem)
            raise DeviceFault("{device}: control is refused: {reason}", "", WATCHDOG, device=self.who, reason=problem)

    def disarm(self) -> None:
        """Switch our outputs to their safe state and the watchdog off."""
        self.link.write_registers(self._watchdog + registers.COMMAND, registers.RELEASE)

    def owner_of(self, state: Image) -> str | None:
        """Return who triggers our watchdog, by the number stored in it; None when it is not running."""
        watchdog = self._s.watchdog
        running, number = state.watchdog(watchdog)
        if running is not WatchdogState.RUNNING:
            return None
        if number == self._number:
            return OWNED_BY_US
        return Phrase.of("another host (number {number} on watchdog {watchdog})", number=number, watchdog=watchdog)

    def why_control_ended(self, state: Image) -> str:
        """Return why our watchdog no longer runs; empty while it runs."""
        number = self._s.watchdog
        running, _ = state.watchdog(number)
        if running is WatchdogState.RUNNING:
            return super().why_control_ended(state)
        text = "watchdog {number} does not run ({register}): the block or another host switched it off"
        if running is WatchdogState.EXPIRED:
            self.set_alarm(WATCHDOG, True)
            text = "watchdog {number} has expired ({register}); the outputs are safe until control is taken"
        register = Message.of(
            "input register {register} is {value}", register=registers.WATCHDOG_STATES + number, value=running
        )
        return Phrase.of(text, number=number, register=register)

    # -------------------------------------------------------------------------------- outputs
    def digital(self, name: str) -> bool:
        """Return the debounced value of a digital point."""
        value = self.digital_points.value(name)
        if value is None:
            self.observing.check()
            raise ConnectionLost("{device}: the value of {name} is not known yet", device=self.who, name=name)
        return value

    def newest_digital(self, name: str) -> Reading[bool | float]:
        """Return the newest value of a digital point, debounced. Raises Stale, NotConnected, ConnectionLost."""
        _, asked, stamp = self._polled.current()
        return Reading[bool | float](self.digital(name), stamp, asked)

    def switch(self, name: str, value: bool) -> None:
        """Switch a digital output."""
        self.send(f"writing {name}", lambda: self.link.write_coil(self.block_points[name].channel, value))

    def pulse_output(self, name: str, duration: float) -> None:
        """Switch a digital output on for `duration` s, timed by the block, and wait until it is off again."""
        who, channel, what = self.who, self.block_points[name].channel, f"the pulse of {name}"
        within(f"{who}: duration", duration, 0.01, registers.MAX_PULSE_TIME, "s")
        self.require_control(f"pulsing {name}")
        go_on = self.begin(what)
        with self._one_pulse:
            if channel in self._pulsing:
                raise Refused("{device}: pulsing {name} is refused while it is being pulsed", device=who, name=name)
            self._pulsing.add(channel)

        def over(image: Image) -> bool:
            self.require_control(what)
            return not image.digital("DO", channel)

        try:
            with self._one_pulse:
                go_on()
                self.link.write_registers(registers.PULSE + channel, round(1000.0 * duration))
            self.wait(over, duration + self.answers_within, what, go_on)
        except DeviceTimeout:
            with contextlib.suppress(DeviceError):  # the block's own timer ends the pulse
                self.link.write_registers(registers.PULSE + channel, 0)
            raise
        finally:
            self._pulsing.discard(channel)

    def stop(self) -> None:
        """End the calls that wait, with Cancelled, and end all pulses."""
        self.stop_waiting()
        with self._one_pulse:  # a pulse that has not started yet is cancelled
            for channel in sorted(self._pulsing):
                self.link.write_registers(registers.PULSE + channel, 0)
