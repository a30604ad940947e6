"""A PLC over OPC UA as an object type: named points, edges, and jobs that are run by a handshake."""

from collections.abc import Callable
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, LossReaction, Quality, Reading, Severity
from arcor2_hw.exceptions import DeviceFault, Refused
from arcor2_hw.objects import IOBlock
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.small import IOPoint

from .edges import Edge
from .jobs import Jobs
from .link import status_name
from .plc import Plc
from .settings import LONGEST_PATIENCE, OpcUaPlcSettings, within
from .values import quality, stamp

LONGEST_WAIT: Final = 600.0
MARGIN: Final = 20.0
"""s beyond it: the request, its taking back, a late answer."""
STOP_TIME: Final = 0.5
"""s a job of the PLC's program takes to stop; the declared reaction counts on it."""
BUILD_INFO: Final = 2260
PROGRAM_STANDS: Final = "program_stands"


class OpcUaPlc(IOBlock):
    """A PLC over OPC UA: named points, and jobs that are run by a handshake."""

    _ABSTRACT = False
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(LONGEST_PATIENCE + STOP_TIME)
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"run_job": "stop", "wait_for": "stop"}
    DYNAMIC_PARAMS: ClassVar[dict[str, tuple[str, set[str]]]] = {"name": ("point_names", set())}

    def __init__(self, obj_id: str, name: str, settings: OpcUaPlcSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._plc = Plc(name, settings)
        self._jobs = Jobs(self._plc)
        self._since = ""

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Open a session and a subscription within `timeout` s, to observe; nothing is written.

        Raises NotConnected, DeviceTimeout, Refused when the server does not let us in, DeviceFault naming a node that
        is not there or has another type.
        """
        self._plc.observing.start(timeout)

    def disconnect(self) -> None:
        """Close. When control is ours it is given back first, and a job that runs is stopped by the PLC."""
        self._plc.disconnect()

    @property
    def connection(self) -> Connection:
        """Tell how the connection is."""
        return self._plc.observing.state

    @property
    def health(self) -> Health:
        """Give failure without a connection or when the PLC's program stands, check_function for a bad point."""
        if self.connection in (Connection.LOST, Connection.FAILED) or self._plc.program_stands:
            return Health.FAILURE
        return Health.CHECK_FUNCTION if self.alarms() else Health.NORMAL

    def alarms(self) -> list[Alarm]:
        """Give what is wrong now: the PLC's program stands, a point is bad. Each ends with its cause."""
        found = []
        if self._plc.program_stands and self._plc.observing.online:
            self._since = self._since or now()
            text, remedy = "the life sign of the PLC's program stands still", "start the PLC's program"
            found.append(Alarm(PROGRAM_STANDS, Severity.ERROR, text, remedy, self._since))
        else:
            self._since = ""
        for name, value in self._plc.told().items():
            if quality(value) is Quality.BAD:
                text = f"the point {name} is {status_name(value)}"
                remedy = "check the module and the wire that it comes from"
                found.append(Alarm(f"bad_{name}", Severity.WARNING, text, remedy, stamp(value)))
        return found

    def identify(self) -> Identity:
        """Ask the server about its build (BuildInfo)."""
        info = self._plc.link.read_standard(BUILD_INFO)
        names = ("ManufacturerName", "ProductName", "SoftwareVersion")
        vendor, model, firmware = (str(getattr(info, name, None) or "") for name in names)
        return Identity(vendor, model, "", firmware)

    def take_control(self) -> None:
        """Enter our number as owner, and begin to give a life sign; no output is written.

        Raises NotInControl naming who has control, Refused for a PLC without a handshake.
        """
        self._plc.take_control()

    def release_control(self) -> None:
        """Give control back; a job that runs is stopped by the PLC, outputs stay."""
        self._plc.release_control()

    def control_owner(self) -> str | None:
        """Tell who has control: "us", another host by its number, or None."""
        return self._plc.control_owner()

    # -------------------------------------------------------------------------------- points
    def points(self) -> list[IOPoint]:
        """Give the points."""
        return [point.io for point in self._plc.points.values()]

    def point_names(self) -> list[str]:
        """Give the names of the points."""
        return list(self._plc.points)

    def read(self, name: str) -> Reading[bool | float]:
        """Read a point now, in its unit, with the source's time stamp and the quality of its status.

        Raises OutOfRange for an unknown name, DeviceFault when the point has no value, Stale while the PLC's program
        stands, NotConnected, ConnectionLost, DeviceTimeout.
        """
        asked = Reading.of(None)
        found = self._plc.read(name)
        point = self._plc.points[name]
        assert found.Value is not None
        value = bool(found.Value.Value) if point.digital else float(found.Value.Value) * point.io.scale
        return Reading[bool | float](value, stamp(found), asked.monotonic, quality(found))

    def write(self, name: str, value: bool | float) -> None:
        """Write an output. Raises Refused for an input, NotInControl, OutOfRange, ConnectionLost, DeviceTimeout."""
        self._plc.write(name, value)

    def subscribe(self, name: str, listener: Callable[[Edge], None]) -> Callable[[], None]:
        """Call `listener` with each edge of a digital point, on the thread of the connection: be quick there.

        What is given back ends the subscription. It outlives a loss; what changed meanwhile is told by no edge.
        """
        self._of_kind(name, digital=True)
        return self._plc.edges.add(name, listener)

    def stop(self) -> None:
        """Stop the job that runs, and return when it stands; what waits here ends with Cancelled. Outputs stay."""
        self._jobs.stop()

    def _of_kind(self, name: str, *, digital: bool) -> None:
        if self._plc.point(name).digital is not digital:
            raise Refused(f"{self._plc.who}: {name} is {'analogue' if digital else 'digital'}")

    def _sound(self, name: str) -> bool | float:
        reading = self.read(name)
        if reading.quality is Quality.BAD:
            told = status_name(self._plc.read(name))
            raise DeviceFault(f"{self._plc.who}: {name} is bad: {told}", "", told)
        return reading.value

    # -------------------------------------------------------------------------------- actions
    @action(deadline=LONGEST_WAIT + MARGIN)
    def run_job(self, number: int, timeout: float = 60.0, *, an: str | None = None) -> None:
        """Have the PLC run one of its jobs, and return when it has done it.

        :param number: number of the job, as the PLC's program counts
        :param timeout: how long the job may take, s; one that takes longer is stopped
        """
        assert 0.1 <= timeout <= 600.0

        within(f"{self._plc.who}: timeout", timeout, 0.1, LONGEST_WAIT)
        self._jobs.run(number, timeout)

    @action
    def read_digital(self, name: str, *, an: str | None = None) -> bool:
        """Read a digital point.

        :param name: name of the point
        """
        self._of_kind(name, digital=True)
        return bool(self._sound(name))

    @action
    def read_analog(self, name: str, *, an: str | None = None) -> float:
        """Read an analogue point, in its unit.

        :param name: name of the point
        """
        self._of_kind(name, digital=False)
        return float(self._sound(name))

    @action
    def write_digital(self, name: str, value: bool, *, an: str | None = None) -> None:
        """Switch a digital output.

        :param name: name of the output
        :param value: on or off
        """
        self._of_kind(name, digital=True)
        self._plc.write(name, value)

    @action
    def write_analog(self, name: str, value: float, *, an: str | None = None) -> None:
        """Set an analogue output, in its unit.

        :param name: name of the output
        :param value: the value, in the unit of the point
        """
        self._of_kind(name, digital=False)
        self._plc.write(name, value)

    @action(deadline=LONGEST_WAIT + MARGIN)
    def wait_for(self, name: str, value: bool, timeout: float, *, an: str | None = None) -> None:
        """Wait until a digital point has the value.

        :param name: name of the point
        :param value: on or off
        :param timeout: how long at most, s
        """
        assert 0.0 <= timeout <= 600.0

        within(f"{self._plc.who}: timeout", timeout, 0.0, LONGEST_WAIT)
        self._of_kind(name, digital=True)
        self._plc.wait_for(name, value, timeout)
