"""Settings of a remote I/O block and of a tower light on one, checked when they are given."""

import dataclasses
import math
from typing import Final

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import check_host, check_serial_port

from .patterns import parse_patterns
from .points import Point, parse_address, parse_points
from .registers import WATCHDOGS

LONGEST_WATCHDOG: Final = 5000
"""ms: what the types declare as their reaction to a loss (`loss_reaction`) holds up to here."""
LONGEST_REQUEST: Final = 0.5
"""s: disconnect may have to wait for one request."""
BAUDRATES: Final = (9600, 19200, 38400, 57600, 115200)


def within(name: str, value: float, low: float, high: float) -> None:
    """Raise OutOfRange, naming the parameter, unless the value lies in the range."""
    if not (math.isfinite(value) and low <= value <= high):
        raise OutOfRange(f"{name} must be {low:g} to {high:g}, not {value!r}")


@dataclasses.dataclass
class BlockSettings(Settings):
    """Where a block is, and how long it may take.

    :param host: address or name of the block on Modbus TCP; empty for a serial line
    :param port: port of its Modbus TCP server
    :param serial_port: serial port of a block on Modbus RTU; empty for TCP
    :param baudrate: bits per second on the serial line (8 data bits, no parity, 1 stop bit)
    :param unit_id: Modbus unit id
    :param watchdog: which of the block's watchdogs is ours; each object on the same block takes another
    :param watchdog_ms: ms of our silence after which the block puts our outputs into their safe state
    :param request_timeout: seconds the block has to answer one request
    """

    host: str = ""
    port: int = 502
    serial_port: str = ""
    baudrate: int = 19200
    unit_id: int = 1
    watchdog: int = 0
    watchdog_ms: int = 1000
    request_timeout: float = 0.25

    def __post_init__(self) -> None:
        self.serial_port = self.serial_port.strip()
        if bool(self.host.strip()) == bool(self.serial_port):
            raise OutOfRange("host must be the address of the block, or serial_port its serial port: one of the two")
        if self.serial_port:
            check_serial_port("serial_port", self.serial_port)
        else:
            check_host(self.host, self.port)
        if self.baudrate not in BAUDRATES:
            raise OutOfRange(f"baudrate must be one of {', '.join(map(str, BAUDRATES))}, not {self.baudrate!r}")
        within("unit_id", self.unit_id, 1 if self.serial_port else 0, 247 if self.serial_port else 255)
        within("watchdog", self.watchdog, 0, WATCHDOGS - 1)
        within("watchdog_ms", self.watchdog_ms, 200, LONGEST_WATCHDOG)
        # A reading that is asked for a second time must not trip the watchdog: two time-outs, one in which a serial
        # line is drained, and one to spare.
        within("request_timeout", self.request_timeout, 0.05, min(LONGEST_REQUEST, self.watchdog_ms / 4000.0))


@dataclasses.dataclass
class RemoteIOSettings(BlockSettings):
    """A block and its named points.

    :param points: name=terminal and options, parted by semicolons: "part=DI0 debounce=0.02; valve=DO4 on_loss=off;
        level=AI0 scale=0.001 unit=m"; debounce in s for DI, on_loss hold, off or on for DO (hold or off for AO; off
        when not given), scale and unit for AI and AO
    """

    points: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        parse_points(self.points)


COLORS: Final = ("red", "amber", "green", "blue", "white")


@dataclasses.dataclass
class TowerLightSettings(BlockSettings):
    """A block, the outputs that a tower light's lamps are at, and what they show.

    :param red: output of the red lamp, as DO0; empty when there is none
    :param amber: output of the amber lamp
    :param green: output of the green lamp
    :param blue: output of the blue lamp
    :param white: output of the white lamp
    :param buzzer: output of the buzzer
    :param on_loss: colour that is lit when the block loses us; empty for none
    :param blink_period: seconds from one flash to the next
    :param patterns: what show_state shows: "execute=green; aborted=red+amber blinking; idle=off"; empty for the usual
    """

    red: str = ""
    amber: str = ""
    green: str = ""
    blue: str = ""
    white: str = ""
    buzzer: str = ""
    on_loss: str = ""
    blink_period: float = 1.0
    patterns: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        within("blink_period", self.blink_period, 0.2, 10.0)
        fitted = self.lamps()
        if not fitted:
            raise OutOfRange(f"one of {', '.join(COLORS)} must be the output of a lamp")
        if self.on_loss and self.on_loss not in fitted:
            raise OutOfRange(f"on_loss must be one of {', '.join(fitted)} or empty, not {self.on_loss!r}")
        parse_patterns(self.patterns, fitted)
        self.points()

    def lamps(self) -> list[str]:
        """Give the colours that are there."""
        return [color for color in COLORS if getattr(self, color)]

    def points(self) -> dict[str, Point]:
        """Give lamps and buzzer as points. Raises OutOfRange naming the parameter."""
        used: dict[str, str] = {}
        for name in (*COLORS, "buzzer"):
            terminal = getattr(self, name)
            if not terminal:
                continue
            if parse_address(terminal, name)[0] != "DO":
                raise OutOfRange(f"{name} must be a digital output such as DO0, not {terminal}")
            if terminal in used.values():
                raise OutOfRange(f"{name} must be an output of its own: {terminal} is another lamp's")
            used[name] = terminal
        on = self.on_loss
        return parse_points(
            "; ".join(f"{name}={terminal} on_loss={'on' if name == on else 'off'}" for name, terminal in used.items())
        )
