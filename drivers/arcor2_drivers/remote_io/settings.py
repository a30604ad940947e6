"""Settings of a remote I/O block, and of a tower light on one."""

import dataclasses
from collections.abc import Collection, Mapping
from typing import Annotated, Final

from arcor2_hw.actions import StrEnum
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects.machine import MachineStateName
from arcor2_hw.objects.modbus_settings import ModbusSettings
from arcor2_hw.objects.point_list import entries, io_point
from arcor2_hw.objects.settings import Range, one_of, within

from .points import Point, parse_address, parse_points
from .registers import WATCHDOGS

MAX_WATCHDOG_TIMEOUT: Final = 5000
"""Longest watchdog time, ms; declared in `loss_reaction`."""
MAX_REQUEST_TIMEOUT: Final = 0.5
"""Longest timeout of a request, s: disconnecting may have to wait for a request."""
BAUDRATES: Final = (9600, 19200, 38400, 57600, 115200)
DEFAULT_PATTERNS: Final = (
    "execute=green; starting=green blinking; completing=green; complete=green blinking; idle=white; "
    "resetting=white blinking; held=amber; holding=amber blinking; unholding=amber blinking; suspended=amber; "
    "suspending=amber blinking; unsuspending=amber blinking; stopped=amber; stopping=amber blinking; "
    "aborting=red blinking; aborted=red blinking; clearing=red"
)
"""Default patterns; those with missing colours are left out (meaning of colours: IEC 60204-1, 10.3)."""
Pattern = Mapping[str, bool]
"""Whether each lit colour blinks."""


class LampColor(StrEnum):
    """Colours of lamps."""

    RED = "red"
    AMBER = "amber"
    GREEN = "green"
    BLUE = "blue"
    WHITE = "white"


@dataclasses.dataclass
class BlockSettings(ModbusSettings):
    """Address of a block, its watchdog, and time limits.

    :param watchdog: number of the watchdog to use; objects on the same block must use different ones
    :param watchdog_ms: time without a request after which the block switches our outputs to their safe state, ms
    """

    watchdog: Annotated[int, Range(0, WATCHDOGS - 1)] = 0
    watchdog_ms: Annotated[int, Range(200, MAX_WATCHDOG_TIMEOUT, "ms")] = 1000

    def __post_init__(self) -> None:
        super().__post_init__()
        one_of("baudrate", self.baudrate, BAUDRATES)
        # A repeated reading takes two timeouts, and one more to drain a serial line; the watchdog must not expire then.
        within("request_timeout", self.request_timeout, 0.05, min(MAX_REQUEST_TIMEOUT, self.watchdog_ms / 4000.0), "s")


@dataclasses.dataclass
class RemoteIOSettings(BlockSettings):
    """A block and its named points.

    :param points: name=terminal and options, separated by semicolons: "part=DI0 debounce=0.02; valve=DO4 on_loss=off;
        level=AI0 scale=0.001 unit=m"; debounce in s for DI, on_loss hold, off or on for DO (hold or off for AO; off
        when omitted), scale and unit for AI and AO
    """

    points: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        parse_points(self.points)


@dataclasses.dataclass
class TowerLightSettings(BlockSettings):
    """The outputs of the lamps of a tower light on a block, and the pattern for each machine state.

    :param red: output of the red lamp, as DO0; empty when there is none
    :param amber: output of the amber lamp
    :param green: output of the green lamp
    :param blue: output of the blue lamp
    :param white: output of the white lamp
    :param buzzer: output of the buzzer
    :param on_loss: colour that is lit when the connection to the block is lost; empty for none
    :param blink_period: time from one flash to the next, s
    :param patterns: of show_state: "execute=green; aborted=red+amber blinking; idle=off"; empty for the default
    """

    red: str = ""
    amber: str = ""
    green: str = ""
    blue: str = ""
    white: str = ""
    buzzer: str = ""
    on_loss: str = ""
    blink_period: Annotated[float, Range(0.2, 10.0, "s")] = 1.0
    patterns: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        fitted = self.lamps()
        if not fitted:
            raise OutOfRange("one of {colors} must be the output of a lamp", colors=", ".join(LampColor))
        if self.on_loss and self.on_loss not in fitted:
            raise OutOfRange(
                "on_loss must be one of {colors} or empty, not {color!r}", colors=", ".join(fitted), color=self.on_loss
            )
        parse_patterns(self.patterns, fitted)
        self.points()

    def lamps(self) -> list[str]:
        """Return the colours of the lamps that the tower has."""
        return [str(color) for color in LampColor if getattr(self, color)]

    def points(self) -> dict[str, Point]:
        """Return lamps and buzzer as points. Raises OutOfRange, which names the parameter."""
        points: dict[str, Point] = {}
        outputs = {name: terminal for name in (*LampColor, "buzzer") if (terminal := getattr(self, name))}
        for name, terminal in outputs.items():
            kind, channel = parse_address(terminal, name)
            if kind != "DO":
                raise OutOfRange(
                    "{name} must be a digital output such as DO0, not {terminal}", name=name, terminal=terminal
                )
            if any(point.channel == channel for point in points.values()):
                raise OutOfRange("{name} must not use {terminal}: another lamp uses it", name=name, terminal=terminal)
            options = ["on_loss=on"] if name == self.on_loss else []
            points[name] = Point(io_point(name, kind, options, name), kind, channel)
        return points


def parse_patterns(text: str, fitted: Collection[str]) -> dict[str, Pattern]:
    """Return the pattern of each state in "execute=green; aborted=red+amber blinking; idle=off". Raises OutOfRange."""
    given, known = bool(text.strip()), ", ".join(fitted)
    patterns: dict[str, Pattern] = {}
    for state, (lamps, *words) in entries(text if given else DEFAULT_PATTERNS, ";", "patterns").items():
        if words not in ([], ["blinking"]):
            raise OutOfRange(
                "patterns: {state} may be followed only by blinking, not {words}", state=state, words=" ".join(words)
            )
        if state not in (states := list(MachineStateName)):
            names = ", ".join(states)
            raise OutOfRange("patterns must name a state of {names}, not {state!r}", names=names, state=state)
        colors = [] if lamps == "off" else lamps.split("+")
        unknown = [color for color in colors if color not in fitted]
        if unknown and given:
            raise OutOfRange(
                "patterns: {color!r} for {state} is not one of {known}, off", color=unknown[0], state=state, known=known
            )
        if not unknown:
            patterns[state] = dict.fromkeys(colors, bool(words))
    return patterns
