"""Settings of a remote I/O block and of a tower light on one, checked when they are given."""

import dataclasses
import math
from typing import Final

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings

from .points import parse_points
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
        if bool(self.host.strip()) == bool(self.serial_port.strip()):
            raise OutOfRange("host must be the address of the block, or serial_port its serial port: one of the two")
        within("port", self.port, 1, 65535)
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
