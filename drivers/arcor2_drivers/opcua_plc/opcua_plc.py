"""The object type of a PLC over OPC UA: named points, edges, and jobs that are run by a handshake."""

from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Health, Identity, LossReaction, Quality, Reading, Severity
from arcor2_hw.exceptions import DeviceFault
from arcor2_hw.objects import IOBlock
from arcor2_hw.objects.connected import Connected
from arcor2_hw.objects.point_actions import LONGEST_WAIT, MARGIN, PointActions
from arcor2_hw.objects.settings import within

from .jobs import Jobs
from .link import status_name
from .plc import Plc
from .settings import LONGEST_PATIENCE, OpcUaPlcSettings
from .values import quality, stamp

STOP_TIME: Final = 0.5
"""Time a job of the PLC takes to stop, s; part of the declared reaction to a loss."""
BUILD_INFO: Final = 2260
PROGRAM_STOPPED: Final = "program_stands"


class OpcUaPlc(PointActions, Connected, IOBlock):
    """A PLC over OPC UA: named points, and jobs that are run by a handshake."""

    _ABSTRACT = False
    display_name = "OPC UA PLC"
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(LONGEST_PATIENCE + STOP_TIME)
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"run_job": "stop", "wait_for": "stop"}

    def __init__(self, obj_id: str, name: str, settings: OpcUaPlcSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._plc = Plc(name, settings)
        self._jobs = Jobs(self._plc)
        self._since = ""
        self.keep_connection(self._plc.who, self._plc.observing)
        self.io_points = {name: point.io for name, point in self._plc.points.items()}
        self.edge_listeners = self._plc.edges

    # -------------------------------------------------------------------------------- connection
    def disconnect(self) -> None:
        """Release control, which stops a running job, and close; does nothing when closed."""
        self._plc.disconnect()

    def condition(self) -> Health:
        """Return failure while the program of the PLC is stopped, check_function for a bad point."""
        if self._plc.program_stopped:
            return Health.FAILURE
        return Health.CHECK_FUNCTION if self.alarms() else Health.NORMAL

    def alarms(self) -> list[Alarm]:
        """Return an alarm for a stopped program of the PLC, and for each bad point."""
        found = []
        if self._plc.program_stopped and self._plc.observing.online:
            self._since = self._since or now()
            text, remedy = "the life sign of the PLC program does not change", "start the program of the PLC"
            found.append(Alarm(PROGRAM_STOPPED, Severity.ERROR, text, remedy, self._since))
        else:
            self._since = ""
        for name, value in self._plc.newest_values().items():
            if quality(value) is Quality.BAD:
                text = f"the point {name} is {status_name(value)}"
                remedy = "check its I/O module and wiring"
                found.append(Alarm(f"bad_{name}", Severity.WARNING, text, remedy, stamp(value)))
        return found

    def identify(self) -> Identity:
        """Read the build information of the server (BuildInfo)."""
        info = self._plc.link.read_standard(BUILD_INFO)
        names = ("ManufacturerName", "ProductName", "SoftwareVersion")
        vendor, model, firmware = (str(getattr(info, name, None) or "") for name in names)
        return Identity(vendor, model, "", firmware)

    def take_control(self) -> None:
        """Write our number as owner, and start our life sign; no output is written.

        Raises NotInControl, which names the owner, or Refused for a PLC without a handshake.
        """
        self._plc.take_control()

    def release_control(self) -> None:
        """Release control; the PLC stops a running job, outputs stay."""
        self._plc.release_control()

    def control_owner(self) -> str | None:
        """Return who has control: "us", another host by its number, or None."""
        return self._plc.control_owner()

    # -------------------------------------------------------------------------------- points
    def read(self, name: str) -> Reading[bool | float]:
        """Read a point now, in its unit, with the time stamp of the source and the quality of its status.

        Raises OutOfRange for an unknown name, DeviceFault when the point has no value, Stale while the
        program of the PLC is stopped, NotConnected, ConnectionLost, DeviceTimeout.
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

    def stop(self) -> None:
        """Stop the running job and wait until it has ended; calls that wait end with Cancelled. Outputs stay."""
        self._jobs.stop()

    def bad_reading(self, name: str) -> DeviceFault:
        """Return the error for a point whose status is bad."""
        status = status_name(self._plc.read(name))
        return DeviceFault("{device}: {name} is bad: {status}", "", status, device=self.who, name=name, status=status)

    def await_point(self, name: str, value: bool, timeout: float) -> None:
        """Return when a digital point has the value."""
        self._plc.wait_for(name, value, timeout)

    # -------------------------------------------------------------------------------- actions
    @action(deadline=LONGEST_WAIT + MARGIN)
    def run_job(self, number: int, timeout: float = 60.0, *, an: str | None = None) -> None:
        """Run a job of the PLC, and return when it is done.

        :param number: number of the job in the program of the PLC
        :param timeout: time limit, s; a job that takes longer is stopped
        """
        assert 0.1 <= timeout <= 600.0

        within(f"{self.who}: timeout", timeout, 0.1, LONGEST_WAIT)
        self._jobs.run(number, timeout)
