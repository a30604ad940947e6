"""Settings of a remote I/O block, and of a tower light on one."""

import dataclasses
from collections.abc import Collection, Mapping
from typing import Annotated, Final

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import MachineState, Settings
from arcor2_hw.objects.settings import Range, check_host, check_serial_port, within

from .points import Point, parse_address, parse_points
from .registers import WATCHDOGS

LONGEST_WATCHDOG: Final = 5000
"""Longest watchdog time, ms; the types declare it as their reaction to a loss (`loss_reaction`)."""
LONGEST_REQUEST: Final = 0.5
"""Longest time for a request, s: disconnecting may have to wait for one."""
BAUDRATES: Final = (9600, 19200, 38400, 57600, 115200)
COLORS: Final = ("red", "amber", "green", "blue", "white")
DEFAULT_PATTERNS: Final = (
    "execute=green; starting=green blinking; completing=green; complete=green blinking; "
    "idle=white; resetting=white blinking; held=amber; holding=amber blinking; unholding=amber blinking; "
    "suspended=amber; suspending=amber blinking; unsuspending=amber blinking; stopped=amber; "
    "stopping=amber blinking; aborting=red blinking; aborted=red blinking; clearing=red"
)
"""Patterns of the states, as far as the tower has the colours (meaning of colours: IEC 60204-1, 10.3)."""
Pattern = Mapping[str, bool]
"""The colours that are lit, each with whether it blinks."""


@dataclasses.dataclass
class BlockSettings(Settings):
    """Where a block is, and how long it may take.

    :param host: address or name of the block on Modbus TCP; empty for a serial line
    :param port: port of its Modbus TCP server
    :param serial_port: serial port of a block on Modbus RTU; empty for TCP
    :param baudrate: bits per second on the serial line (8 data bits, no parity, 1 stop bit)
    :param unit_id: Modbus unit id
    :param watchdog: number of the block's watchdog to use; each object on the same block uses another
    :param watchdog_ms: ms without a request after which the block puts our outputs into their safe state
    :param request_timeout: seconds the block has to answer one request
    """

    host: str = ""
    port: int = 502
    serial_port: str = ""
    baudrate: int = 19200
    unit_id: int = 1
    watchdog: Annotated[int, Range(0, WATCHDOGS - 1)] = 0
    watchdog_ms: Annotated[int, Range(200, LONGEST_WATCHDOG, "ms")] = 1000
    request_timeout: float = 0.25

    def __post_init__(self) -> None:
        super().__post_init__()
        self.serial_port = self.serial_port.strip()
        if bool(self.host.strip()) == bool(self.serial_port):
            raise OutOfRange("host must be the address of the block, or serial_port its serial port: one of the two")
        if self.serial_port:
            check_serial_port("serial_port", self.serial_port)
        else:
            check_host(self.host, self.port)
        if self.baudrate not in BAUDRATES:
            raise OutOfRange(
                "baudrate must be one of {baudrates}, not {baudrate!r}",
                baudrates=", ".join(map(str, BAUDRATES)),
                baudrate=self.baudrate,
            )
        within("unit_id", self.unit_id, 1 if self.serial_port else 0, 247 if self.serial_port else 255)
        # A repeated reading must not trip the watchdog: two time-outs, one to drain a serial line, and one to spare.
        within("request_timeout", self.request_timeout, 0.05, min(LONGEST_REQUEST, self.watchdog_ms / 4000.0), "s")


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
    """A block, the outputs of a tower light's lamps, and the patterns they show.

    :param red: output of the red lamp, as DO0; empty when there is none
    :param amber: output of the amber lamp
    :param green: output of the green lamp
    :param blue: output of the blue lamp
    :param white: output of the white lamp
    :param buzzer: output of the buzzer
    :param on_loss: colour that is lit when the connection to the block is lost; empty for none
    :param blink_period: seconds from one flash to the next
    :param patterns: what show_state shows: "execute=green; aborted=red+amber blinking; idle=off"; empty for the default
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
            raise OutOfRange("one of {colors} must be the output of a lamp", colors=", ".join(COLORS))
        if self.on_loss and self.on_loss not in fitted:
            raise OutOfRange(
                "on_loss must be one of {fitted} or empty, not {on_loss!r}",
                fitted=", ".join(fitted),
                on_loss=self.on_loss,
            )
        parse_patterns(self.patterns, fitted)
        self.points()

    def lamps(self) -> list[str]:
        """Return the colours that the tower has."""
        return [color for color in COLORS if getattr(self, color)]

    def points(self) -> dict[str, Point]:
        """Return lamps and buzzer as points. Raises OutOfRange naming the parameter."""
        used: dict[str, str] = {}
        for name in (*COLORS, "buzzer"):
            terminal = getattr(self, name)
            if not terminal:
                continue
            if parse_address(terminal, name)[0] != "DO":
                raise OutOfRange(
                    "{name} must be a digital output such as DO0, not {terminal}", name=name, terminal=terminal
                )
            if terminal in used.values():
                raise OutOfRange(
                    "{name} must be an output of its own: {terminal} is used by another lamp",
                    name=name,
                    terminal=terminal,
                )
            used[name] = terminal
        safe = {name: "on" if name == self.on_loss else "off" for name in used}
        return parse_points("; ".join(f"{name}={terminal} on_loss={safe[name]}" for name, terminal in used.items()))


def parse_patterns(text: str, fitted: Collection[str]) -> dict[str, Pattern]:
    """Return the lamps by state: "execute=green; aborted=red+amber blinking; idle=off". Raises OutOfRange."""
    given = bool(text.strip())
    states = [state.name.lower() for state in MachineState]
    patterns: dict[str, Pattern] = {}
    for entry in filter(None, (part.strip() for part in (text if given else DEFAULT_PATTERNS).split(";"))):
        head, *words = entry.split()
        state, sign, lamps = head.partition("=")
        if not sign or not lamps or words not in ([], ["blinking"]):
            raise OutOfRange(
                "patterns must be a list of state=colour or state=colour blinking, not {entry!r}", entry=entry
            )
        if state not in states:
            raise OutOfRange(
                "patterns must name a state of {states}, not {state!r}", states=", ".join(states), state=state
            )
        if state in patterns:
            raise OutOfRange("patterns must name each state once: {state!r} is in it twice", state=state)
        colors = [] if lamps == "off" else lamps.split("+")
        unknown = [color for color in colors if color not in fitted]
        if unknown and given:
            raise OutOfRange(
                "patterns must show {state} by {fitted} or off, not {unknown!r}",
                state=state,
                fitted=", ".join(fitted),
                unknown=unknown[0],
            )
        if not unknown:
            patterns[state] = dict.fromkeys(colors, bool(words))
    return patterns
