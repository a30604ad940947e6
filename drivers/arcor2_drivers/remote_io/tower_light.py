"""A tower light on a remote I/O block: colours, blinking, and a pattern for each machine state."""

import contextlib
import threading
import time
from collections.abc import Mapping
from functools import partial
from typing import ClassVar

from arcor2_hw.actions import action
from arcor2_hw.data.points import LivePoint
from arcor2_hw.exceptions import NotInControl, OutOfRange, Refused
from arcor2_hw.objects import Generic
from arcor2_hw.objects.machine import MachineStateName
from arcor2_hw.objects.point_actions import MARGIN
from arcor2_hw.objects.small import live_point

from .block import Block
from .registers import MAX_PULSE_TIME
from .settings import LampColor, Pattern, TowerLightSettings, parse_patterns


class TowerLight(Block, Generic):
    """A tower light at the outputs of a remote I/O block."""

    _ABSTRACT = False
    display_name = "Tower light"
    category = "Signals"
    icon = "light"
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"buzz": "stop"}

    def __init__(self, obj_id: str, name: str, settings: TowerLightSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._lamps = settings.lamps()
        self._patterns = parse_patterns(settings.patterns, self._lamps)
        self._half_period = settings.blink_period / 2.0
        self._showing = threading.RLock()
        self._pattern: Pattern = {}
        self._lit: dict[str, bool] = {}
        self._since = 0.0
        self._forced: frozenset[str] = frozenset()
        """Names of the outputs that a person forces."""
        self.use_block(settings, settings.points())

    def arm(self) -> None:
        """Take control. A pattern shown before a connection loss is not restored."""
        with self._showing:
            self._pattern, self._lit = {}, {}
        super().arm()

    def lit(self) -> dict[str, bool]:
        """Return for each lamp whether it is lit now."""
        self.fresh()
        return {color: self.digital(color) for color in self._lamps}

    @property
    def shown_values(self) -> dict[str, float]:
        """Return for each lamp whether it is lit."""
        return self.digital_points.shown(self._lamps)

    # -------------------------------------------------------------------------------- points
    def live_points(self) -> list[LivePoint]:
        """Return the lamps and the buzzer with their newest states."""
        return [live_point(point.io, self.newest_digital, can_force=True) for point in self.block_points.values()]

    def force_point(self, name: str, value: bool | float) -> None:
        """Force a lamp or the buzzer to a state until `release_point`."""
        if name not in self.block_points:
            raise OutOfRange("{device} has no lamp {name!r}", device=self.who, name=name)
        with self._showing:
            self.switch(name, bool(value))
            self._forced |= {name}

    def release_point(self, name: str, value: bool | float) -> None:
        """End a force. A lamp returns to the shown pattern; without one, to its state from before."""
        with self._showing:
            self._forced -= {name}
            self.switch(name, self._lit.get(name, bool(value)))

    # -------------------------------------------------------------------------------- actions
    @action
    def show(self, color: LampColor, blinking: bool = False, *, an: str | None = None) -> None:
        """Light one lamp and switch the others off.

        :param color: colour of the lamp
        :param blinking: whether the lamp blinks
        """
        if color not in self._lamps:
            lamps = ", ".join(self._lamps)
            raise OutOfRange(
                "{device} has no {color} lamp; there are {lamps}", device=self.who, color=color, lamps=lamps
            )
        self._show({str(color): blinking}, f"showing {color}")

    @action
    def show_state(self, state: MachineStateName, *, an: str | None = None) -> None:
        """Show the state of a machine by its pattern.

        :param state: state of the machine
        """
        if state not in self._patterns:
            raise OutOfRange("{device} has no pattern for the state {state}", device=self.who, state=state)
        self._show(self._patterns[state], f"showing {state}")

    @action
    def off(self, *, an: str | None = None) -> None:
        """Turn all lamps off."""
        self._show({}, "switching the lamps off")

    @action(deadline=MAX_PULSE_TIME + MARGIN)
    def buzz(self, duration: float, *, an: str | None = None) -> None:
        """Sound the buzzer for a time, and return when it is silent again.

        :param duration: duration, s
        """
        assert 0.01 <= duration <= 60.0

        if "buzzer" not in self.block_points:
            raise OutOfRange("{device} has no buzzer. Set buzzer to its output.", device=self.who)
        if "buzzer" in self._forced:
            raise Refused("{device}: {name} is forced. End the force first.", device=self.who, name="buzzer")
        self.pulse_output("buzzer", duration)

    # -------------------------------------------------------------------------------- lamps
    def _show(self, pattern: Pattern, operation: str) -> None:
        with self._showing:
            self.require_control(operation)
            self._pattern, self._since, self._lit = pattern, time.monotonic(), {}
            self._switch_lamps(dict.fromkeys(self._lamps, False) | dict.fromkeys(pattern, True))

    def after_reading(self) -> None:
        """Switch the blinking lamps."""
        super().after_reading()
        with self._showing, contextlib.suppress(NotInControl):  # control may end at any time
            if self._lit and self.in_control:
                phase = int((time.monotonic() - self._since) / self._half_period)
                self._switch_lamps({color: phase % 2 == 0 for color, blinks in self._pattern.items() if blinks})

    def _switch_lamps(self, wanted: Mapping[str, bool]) -> None:
        # First off, then on: two colours at the same time may have another meaning.
        for color, on in sorted(wanted.items(), key=lambda lamp: lamp[1]):
            if self._lit.get(color) is not on:
                if color not in self._forced:
                    self.repeat_once(partial(self.switch, color, on))
                self._lit[color] = on
