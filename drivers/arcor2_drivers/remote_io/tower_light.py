"""A tower light on a remote I/O block as an object type: colours, blinking, and a pattern per machine state."""

import threading
import time
from collections.abc import Mapping
from typing import ClassVar, Final

from arcor2_hw.actions import StrEnum, action
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, LossReaction
from arcor2_hw.exceptions import NotFound, OutOfRange
from arcor2_hw.objects import Generic
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from .block import Block
from .patterns import Pattern, parse_patterns
from .registers import LONGEST_PULSE
from .remote_io import MARGIN, diagnoses
from .settings import LONGEST_WATCHDOG, TowerLightSettings

DARK: Final[Pattern] = {}


class LampColor(StrEnum):
    """The colours a tower may have."""

    RED = "red"
    AMBER = "amber"
    GREEN = "green"
    BLUE = "blue"
    WHITE = "white"


class ShownState(StrEnum):
    """The states of a machine (PackML, ISA-TR88.00.02)."""

    CLEARING = "clearing"
    STOPPED = "stopped"
    STARTING = "starting"
    IDLE = "idle"
    SUSPENDED = "suspended"
    EXECUTE = "execute"
    STOPPING = "stopping"
    ABORTING = "aborting"
    ABORTED = "aborted"
    HOLDING = "holding"
    HELD = "held"
    UNHOLDING = "unholding"
    SUSPENDING = "suspending"
    UNSUSPENDING = "unsuspending"
    RESETTING = "resetting"
    COMPLETING = "completing"
    COMPLETE = "complete"


class TowerLight(Generic):
    """A tower light at the outputs of a remote I/O block."""

    _ABSTRACT = False
    category = "Signals"
    icon = "light"
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(LONGEST_WATCHDOG / 1000.0)
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"buzz": "stop"}

    def __init__(self, obj_id: str, name: str, settings: TowerLightSettings | None = None) -> None:
        super().__init__(obj_id, name, settings)
        if settings is None:
            raise NotFound(f"{name} has no settings: host or serial_port must say where the block is")
        self._lamps = settings.lamps()
        self._patterns: Mapping[str, Pattern] = parse_patterns(settings.patterns, self._lamps)
        self._half_period = settings.blink_period / 2.0
        self._block = Block(name, settings, settings.points(), self._blink)
        self._showing = threading.Lock()
        self._pattern: Pattern = DARK
        self._lit: dict[str, bool] = {}
        self._since = 0.0

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Begin to observe within `timeout` s; nothing is written. Raises NotConnected, DeviceTimeout, DeviceFault."""
        self._block.connect(timeout)

    def disconnect(self) -> None:
        """Stop observing. When control is ours, the lamps show first what they show on loss."""
        self._block.disconnect()

    @property
    def connection(self) -> Connection:
        """Tell how the connection is."""
        return self._block.observing.state

    @property
    def health(self) -> Health:
        """Give the condition as the block last told it; failure when it does not tell any more."""
        image = self._block.newest()
        if self.connection in (Connection.LOST, Connection.FAILED) or (image is not None and image.diagnosis):
            return Health.FAILURE
        return Health.NORMAL

    def identify(self) -> Identity:
        """Ask the block who it is (function 43/14)."""
        self._block.observing.check()
        return self._block.link.identify()

    def alarms(self) -> list[Alarm]:
        """Give what the block complains of; each ends with its cause."""
        return diagnoses(self._block.fresh().value.diagnosis)

    def take_control(self) -> None:
        """Arm the block's watchdog; the lamps stay as they are. Raises NotInControl naming who has it."""
        if not self._block.in_control:
            with self._showing:  # what was shown before a loss does not come back by itself
                self._pattern, self._lit = DARK, {}
        self._block.take_control()

    def release_control(self) -> None:
        """Let the lamps show what they show on loss, and switch the watchdog off."""
        self._block.release_control()

    def control_owner(self) -> str | None:
        """Tell who has control of the lamps: "us", another host, or None."""
        return self._block.control_owner()

    def lit(self) -> dict[str, bool]:
        """Tell of each lamp whether it is lit now."""
        self._block.fresh()
        return {color: self._block.digital(color) for color in self._lamps}

    def stop(self) -> None:
        """End a sound of the buzzer; the lamps stay as they are."""
        self._block.stop()

    # -------------------------------------------------------------------------------- actions
    @action
    def show(self, color: LampColor, blinking: bool = False, *, an: str | None = None) -> None:
        """Light one lamp and put the others out.

        :param color: which lamp
        :param blinking: let it blink
        """
        if color not in self._lamps:
            raise OutOfRange(f"{self._block.who} has no {color} lamp; there are {', '.join(self._lamps)}")
        self._show({str(color): blinking}, f"showing {color}")

    @action
    def show_state(self, state: ShownState, *, an: str | None = None) -> None:
        """Show the state of a machine by its pattern.

        :param state: which state
        """
        if state not in self._patterns:
            raise OutOfRange(f"{self._block.who} has no pattern for the state {state}")
        self._show(self._patterns[state], f"showing {state}")

    @action
    def off(self, *, an: str | None = None) -> None:
        """Put all lamps out."""
        self._show(DARK, "switching the lamps off")

    @action(deadline=LONGEST_PULSE + MARGIN)
    def buzz(self, duration: float, *, an: str | None = None) -> None:
        """Sound the buzzer for a time, and return when it is silent again.

        :param duration: how long, s
        """
        assert 0.01 <= duration <= 60.0

        self._block.pulse("buzzer", duration)

    # -------------------------------------------------------------------------------- lamps
    def _show(self, pattern: Pattern, what: str) -> None:
        with self._showing:
            self._block.require_control(what)
            self._pattern, self._since, self._lit = pattern, time.monotonic(), {}
            self._set(dict.fromkeys(self._lamps, False) | dict.fromkeys(pattern, True))

    def _blink(self) -> None:
        """Let lamps follow their pattern; called over and over on the observing thread."""
        with self._showing:
            if self._lit:
                phase = int((time.monotonic() - self._since) / self._half_period)
                self._set({color: phase % 2 == 0 for color, blinks in self._pattern.items() if blinks})

    def _set(self, wanted: Mapping[str, bool]) -> None:
        # Lamps go out before others are lit: two colours at once may mean something else.
        for color, on in sorted(wanted.items(), key=lambda lamp: lamp[1]):
            if self._lit.get(color) is not on:
                self._block.set_again(color, on)
                self._lit[color] = on
