"""Settings of a conveyor."""

import dataclasses
import re
import urllib.parse
from typing import Annotated, Final

from arcor2_hw.actions import StrEnum
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import Range, check_serial_port, check_url, within

LONGEST_HEARTBEAT: Final = 1000
"""Longest heartbeat time, ms; the type declares it as its reaction to a loss."""
LONGEST_RAMP: Final = 0.5
"""Longest quick stop from the highest speed, s; part of the declared reaction to a loss."""
LONGEST_MOVE: Final = 600.0
"""Longest move, s."""
_INT32: Final = (1 << 31) - 1
_NETWORK_INTERFACE: Final = re.compile(r"[\w.-]{1,15}")


class CanInterface(StrEnum):
    """How python-can reaches the bus."""

    SLCAN = "slcan"
    SOCKETCAN = "socketcan"
    SOCKETCAND = "socketcand"


@dataclasses.dataclass
class ConveyorSettings(Settings):
    """Where the drive is, and its units and limits.

    :param channel: for slcan socket://host:port or a serial port; for socketcan the network interface; for socketcand
        socket://host:port/bus, as socket://10.0.0.2:29536/can0
    :param interface: how the bus is reached
    :param bitrate: bit/s of the bus; slcan only, a network interface has its own
    :param node_id: CANopen node id of the drive
    :param master_id: CANopen node id that we send heartbeats as
    :param counts_per_metre: counts of the drive for one metre of belt; negative inverts the direction
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
    :param pdo_period_ms: ms between the PDOs with the state of the drive while we have control; 0: read by SDO
    :param belt_speed: m/s the belt runs with when it is started as a machine; negative for backwards
    """

    channel: str
    interface: CanInterface = CanInterface.SLCAN
    bitrate: int = 500000
    node_id: Annotated[int, Range(1, 127)] = 5
    master_id: Annotated[int, Range(1, 127)] = 127
    counts_per_metre: float = 10000.0
    max_speed: Annotated[float, Range(0.001, 10.0, "m/s")] = 0.5
    acceleration: Annotated[float, Range(0.01, 100.0, "m/s²")] = 1.0
    quick_stop_deceleration: float = 5.0
    min_position: float = -100.0
    max_position: float = 100.0
    homing_method: Annotated[int, Range(-128, 127)] = 37
    homing_speed: float = 0.1
    homing_timeout: Annotated[float, Range(0.5, LONGEST_MOVE, "s")] = 30.0
    tolerance: float = 0.002
    heartbeat_ms: Annotated[int, Range(200, LONGEST_HEARTBEAT, "ms")] = 800
    sdo_timeout: float = 0.2
    pdo_period_ms: int = 10
    belt_speed: float = 0.2

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_channel()
        if self.bitrate not in (10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000):
            raise OutOfRange("bitrate must be one of CiA 301 such as 500000, not {bitrate!r}", bitrate=self.bitrate)
        if self.master_id == self.node_id:
            raise OutOfRange("master_id must not be the drive's node_id {node_id}", node_id=self.node_id)
        within("counts_per_metre", abs(self.counts_per_metre), 1.0, 1e8)
        within("quick_stop_deceleration", self.quick_stop_deceleration, self.max_speed / LONGEST_RAMP, 1000.0)
        farthest = _INT32 / abs(self.counts_per_metre) / 2.0  # a move may span the range
        within("min_position", self.min_position, -farthest, farthest)
        within("max_position", self.max_position, self.min_position, farthest)
        for name in ("max_speed", "acceleration", "quick_stop_deceleration"):
            within(f"{name} in counts", getattr(self, name) * abs(self.counts_per_metre), 1.0, _INT32)
        within("homing_speed", self.homing_speed, 0.001, self.max_speed)
        within("tolerance", self.tolerance, 1.0 / abs(self.counts_per_metre), 1.0)
        if self.pdo_period_ms:
            within("pdo_period_ms", self.pdo_period_ms, 2, 100)
        within("belt_speed", abs(self.belt_speed), 0.001, self.max_speed)
        # A request that takes its whole time must not delay the heartbeat too long.
        within("sdo_timeout", self.sdo_timeout, 0.02, self.heartbeat_ms / 2000.0)

    def _check_channel(self) -> None:
        match self.interface:
            case CanInterface.SLCAN:
                check_serial_port("channel", self.channel)
            case CanInterface.SOCKETCAN:
                if not _NETWORK_INTERFACE.fullmatch(self.channel):
                    raise OutOfRange(
                        "channel must be a network interface for socketcan, not {channel!r}", channel=self.channel
                    )
            case CanInterface.SOCKETCAND:
                where = check_url("channel", self.channel, "socket")
                if where.port is None or not self.server[2].isidentifier():
                    raise OutOfRange(
                        "channel must be socket://host:port/bus for socketcand, not {channel!r}", channel=self.channel
                    )

    @property
    def server(self) -> tuple[str, int, str]:
        """Return host, port and bus of a channel that is a socket."""
        where = urllib.parse.urlsplit(self.channel)
        return where.hostname or "", where.port or 0, where.path.strip("/")

    def counts(self, value: float) -> int:
        """Return m or m/s in counts of the drive."""
        return round(value * self.counts_per_metre)

    def rate(self, value: float) -> int:
        """Return an unsigned rate (speed, acceleration) in counts of the drive; at least 1."""
        return max(1, round(value * abs(self.counts_per_metre)))

    def metres(self, counts: int) -> float:
        """Return counts in m, or counts/s in m/s."""
        return counts / self.counts_per_metre
