"""Settings of a conveyor, checked when they are given."""

import dataclasses
import math
import re
import urllib.parse
from typing import Final

from arcor2_hw.actions import StrEnum
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import check_serial_port, check_url

LONGEST_HEARTBEAT: Final = 1000
"""ms: what the type declares as its reaction to a loss holds up to here."""
LONGEST_RAMP: Final = 0.5
"""s from the highest speed to a stand by quick stop; the declared reaction counts on it."""
LONGEST_MOVE: Final = 600.0
_INT32: Final = (1 << 31) - 1
_NETWORK_INTERFACE: Final = re.compile(r"[\w.-]{1,15}")


class CanInterface(StrEnum):
    """How python-can reaches the bus."""

    SLCAN = "slcan"
    SOCKETCAN = "socketcan"
    SOCKETCAND = "socketcand"


def _within(name: str, value: float, low: float, high: float) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        raise OutOfRange(f"{name} must be {low:g} to {high:g}, not {value!r}")


@dataclasses.dataclass
class ConveyorSettings(Settings):
    """Where the drive is, and what its counts mean.

    :param channel: for slcan socket://host:port or a serial port; for socketcan the network interface; for socketcand
        socket://host:port/bus, as socket://10.0.0.2:29536/can0
    :param interface: how the bus is reached
    :param bitrate: bit/s of the bus; slcan only, a network interface is set up by its owner
    :param node_id: CANopen node id of the drive
    :param master_id: CANopen node id that we send heartbeats as
    :param counts_per_metre: counts of the drive for one metre of belt; negative turns the direction round
    :param max_speed: highest speed, m/s
    :param acceleration: m/s², also for slowing down
    :param quick_stop_deceleration: m/s², of a quick stop and after a loss
    :param min_position: lowest position move_to and move_by may go to, m
    :param max_position: highest position, m
    :param homing_method: number of the method (CiA 402)
    :param homing_speed: m/s
    :param homing_timeout: seconds homing may take
    :param tolerance: how far from its target a move may end, m
    :param heartbeat_ms: ms without our heartbeat after which the drive stops; below 700 a busy computer stops it
    :param sdo_timeout: seconds the drive has to answer a request
    :param pdo_period_ms: ms between the PDOs by which the drive tells its state while we have control; 0: it is asked
    :param belt_speed: m/s the belt runs with when it is started as a machine; negative for backwards
    """

    channel: str
    interface: CanInterface = CanInterface.SLCAN
    bitrate: int = 500000
    node_id: int = 5
    master_id: int = 127
    counts_per_metre: float = 10000.0
    max_speed: float = 0.5
    acceleration: float = 1.0
    quick_stop_deceleration: float = 5.0
    min_position: float = -100.0
    max_position: float = 100.0
    homing_method: int = 37
    homing_speed: float = 0.1
    homing_timeout: float = 30.0
    tolerance: float = 0.002
    heartbeat_ms: int = 800
    sdo_timeout: float = 0.2
    pdo_period_ms: int = 10
    belt_speed: float = 0.2

    def __post_init__(self) -> None:
        self._check_channel()
        if self.bitrate not in (10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000):
            raise OutOfRange(f"bitrate must be one of CiA 301 such as 500000, not {self.bitrate!r}")
        _within("node_id", self.node_id, 1, 127)
        _within("master_id", self.master_id, 1, 127)
        if self.master_id == self.node_id:
            raise OutOfRange(f"master_id must not be the drive's node_id {self.node_id}")
        _within("counts_per_metre", abs(self.counts_per_metre), 1.0, 1e8)
        _within("max_speed", self.max_speed, 0.001, 10.0)
        _within("acceleration", self.acceleration, 0.01, 100.0)
        _within("quick_stop_deceleration", self.quick_stop_deceleration, self.max_speed / LONGEST_RAMP, 1000.0)
        farthest = _INT32 / abs(self.counts_per_metre) / 2.0  # a move may be as long as the range
        _within("min_position", self.min_position, -farthest, farthest)
        _within("max_position", self.max_position, self.min_position, farthest)
        for name in ("max_speed", "acceleration", "quick_stop_deceleration"):
            _within(f"{name} in counts", getattr(self, name) * abs(self.counts_per_metre), 1.0, _INT32)
        _within("homing_method", self.homing_method, -128, 127)
        _within("homing_speed", self.homing_speed, 0.001, self.max_speed)
        _within("homing_timeout", self.homing_timeout, 0.5, LONGEST_MOVE)
        _within("tolerance", self.tolerance, 1.0 / abs(self.counts_per_metre), 1.0)
        _within("heartbeat_ms", self.heartbeat_ms, 200, LONGEST_HEARTBEAT)
        if self.pdo_period_ms:
            _within("pdo_period_ms", self.pdo_period_ms, 2, 100)
        _within("belt_speed", abs(self.belt_speed), 0.001, self.max_speed)
        # A request that is answered only just in time must not cost the heartbeat.
        _within("sdo_timeout", self.sdo_timeout, 0.02, self.heartbeat_ms / 2000.0)

    def _check_channel(self) -> None:
        match self.interface:
            case CanInterface.SLCAN:
                check_serial_port("channel", self.channel)
            case CanInterface.SOCKETCAN:
                if not _NETWORK_INTERFACE.fullmatch(self.channel):
                    raise OutOfRange(f"channel must be a network interface for socketcan, not {self.channel!r}")
            case CanInterface.SOCKETCAND:
                where = check_url("channel", self.channel, "socket")
                if where.port is None or not self.server[2].isidentifier():
                    raise OutOfRange(f"channel must be socket://host:port/bus for socketcand, not {self.channel!r}")

    @property
    def server(self) -> tuple[str, int, str]:
        """Give host, port and bus of a channel that is a socket."""
        where = urllib.parse.urlsplit(self.channel)
        return where.hostname or "", where.port or 0, where.path.strip("/")

    def counts(self, value: float) -> int:
        """Give m, m/s as the drive counts them."""
        return round(value * self.counts_per_metre)

    def rate(self, value: float) -> int:
        """Give an unsigned rate (speed, acceleration) as the drive counts it; at least 1."""
        return max(1, round(value * abs(self.counts_per_metre)))

    def metres(self, counts: int) -> float:
        """Give counts in m, counts/s in m/s."""
        return counts / self.counts_per_metre
