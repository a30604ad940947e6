"""Settings of a conveyor."""

import dataclasses
import re
import urllib.parse
from typing import Annotated, Final

from arcor2_hw.actions import StrEnum
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import Range, check_serial_port, check_url, one_of, within

MAX_HEARTBEAT_TIME: Final = 1000
"""Longest heartbeat time, ms; the type declares it in `loss_reaction`."""
MAX_RAMP_TIME: Final = 0.5
"""Longest quick stop from the highest speed, s; part of the declared reaction to a loss."""
MAX_MOVE_TIME: Final = 600.0
"""Longest move, s."""
BITRATES: Final = (10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000)
"""Bit rates of CiA 301, bit/s."""
_INT32: Final = (1 << 31) - 1
_NETWORK_INTERFACE: Final = re.compile(r"[\w.-]{1,15}")


class CanInterface(StrEnum):
    """Interface of python-can to the bus."""

    SLCAN = "slcan"
    SOCKETCAN = "socketcan"
    SOCKETCAND = "socketcand"


@dataclasses.dataclass
class ConveyorSettings(Settings):
    """Address of the drive, its units and limits.

    :param channel: for slcan socket://host:port or a serial port; for socketcan the network interface; for socketcand
        socket://host:port/bus, as socket://10.0.0.2:29536/can0
    :param interface: how the bus is reached
    :param bitrate: bit/s of the bus; slcan only, a network interface has its own
    :param node_id: CANopen node id of the drive
    :param master_id: CANopen node id of our heartbeats
    :param counts_per_metre: counts of the drive for one metre of belt; negative inverts the direction
    :param max_speed: highest speed, m/s
    :param acceleration: acceleration and deceleration, m/s²
    :param quick_stop_deceleration: deceleration of a quick stop and after a loss, m/s²
    :param min_position: lowest position of moves, m
    :param max_position: highest position of moves, m
    :param homing_method: number of the homing method (CiA 402)
    :param homing_speed: speed of homing, m/s
    :param homing_timeout: time limit of homing, s
    :param tolerance: largest distance of the end of a move from its target, m
    :param heartbeat_ms: time without our heartbeat after which the drive stops, ms; a busy computer needs 0.7 s or more
    :param sdo_timeout: time the drive has to answer a request, s
    :param pdo_period_ms: period of the PDOs with the state of the drive while we have control, ms; 0: read by SDO
    :param belt_speed: speed of the belt when it is started as a machine, m/s; negative for backwards
    """

    channel: str = dataclasses.field(metadata={"found_by": "serial"})
    interface: CanInterface = CanInterface.SLCAN
    bitrate: int = 500000
    node_id: Annotated[int, Range(1, 127)] = dataclasses.field(default=5, metadata={"found_by": "can"})
    master_id: Annotated[int, Range(1, 127)] = 127
    counts_per_metre: float = 10000.0
    max_speed: Annotated[float, Range(0.001, 10.0, "m/s")] = 0.5
    acceleration: Annotated[float, Range(0.01, 100.0, "m/s²")] = 1.0
    quick_stop_deceleration: float = 5.0
    min_position: float = -100.0
    max_position: float = 100.0
    homing_method: Annotated[int, Range(-128, 127)] = 37
    homing_speed: float = 0.1
    homing_timeout: Annotated[float, Range(0.5, MAX_MOVE_TIME, "s")] = 30.0
    tolerance: float = 0.002
    heartbeat_ms: Annotated[int, Range(200, MAX_HEARTBEAT_TIME, "ms")] = 800
    sdo_timeout: float = 0.2
    pdo_period_ms: int = 10
    belt_speed: float = 0.2

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_channel()
        one_of("bitrate", self.bitrate, BITRATES)
        if self.master_id == self.node_id:
            raise OutOfRange("master_id must not be the drive's node_id {node_id}", node_id=self.node_id)
        within("counts_per_metre", abs(self.counts_per_metre), 1.0, 1e8)
        within("quick_stop_deceleration", self.quick_stop_deceleration, self.max_speed / MAX_RAMP_TIME, 1000.0)
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
        # The longest request must not delay the heartbeat too long.
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
        """Convert m or m/s to counts or counts/s."""
        return round(value * self.counts_per_metre)

    def rate(self, value: float) -> int:
        """Convert a speed or acceleration to counts; the result is positive and at least 1."""
        return max(1, round(value * abs(self.counts_per_metre)))

    def metres(self, counts: int) -> float:
        """Convert counts to m, or counts/s to m/s."""
        return counts / self.counts_per_metre
