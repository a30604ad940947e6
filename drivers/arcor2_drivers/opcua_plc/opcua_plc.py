"""The object type of a PLC over OPC UA: named points, edges, and jobs that are run by a handshake."""

from collections.abc import Mapping
from typing import ClassVar, Final

from asyncua import ua

from arcor2_hw.actions import action
from arcor2_hw.data.device import Alarm, Health, Identity, LossReaction, Quality, Reading, Severity
from arcor2_hw.exceptions import DeviceFault, Stale
from arcor2_hw.messages import Message, translatable
from arcor2_hw.objects import IOBlock
from arcor2_hw.objects.connected import AlarmText
from arcor2_hw.objects.edges import Edge
from arcor2_hw.objects.point_actions import MARGIN, MAX_WAIT, PointActions
from arcor2_hw.objects.settings import within

from .link import status_name
from .plc import Plc
from .settings import MAX_PATIENCE, OpcUaPlcSettings
from .values import content, is_bad, quality, raw, stamp

STOP_TIME: Final = 0.5
"""Time a job of the PLC takes to stop, s; part of the declared reaction to a loss."""
BUILD_INFO: Final = 2260
PROGRAM_STOPPED: Final = "program_stands"


class OpcUaPlc(PointActions, Plc, IOBlock):
    """A PLC over OPC UA: named points, and jobs that are run by a handshake."""

    _ABSTRACT = False
    display_name = "OPC UA PLC"
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(MAX_PATIENCE + STOP_TIME)
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"run_job": "stop", "wait_for": "stop"}
    ALARMS: ClassVar[Mapping[str, AlarmText]] = {
        PROGRAM_STOPPED: AlarmText("the life sign of the PLC program does not change", "start the program of the PLC")
    }

    def __init__(self, obj_id: str, name: str, settings: OpcUaPlcSettings) -> None:
        super().__init__(obj_id, name, settings)
        self.use_plc(settings)
        self.io_points = {name: point.io for name, point in self.plc_points.items()}
        self.edge_listeners = self.digital_points

    # -------------------------------------------------------------------------------- connection
    def condition(self) -> Health:
        """Return failure while the program of the PLC is stopped, check_function for a bad point."""
        if self.program_stopped:
            return Health.FAILURE
        return Health.CHECK_FUNCTION if self.alarms() else Health.NORMAL

    def alarms(self) -> list[Alarm]:
        """Return an alarm for a stopped program of the PLC, and for each bad point."""
        self.set_alarm(PROGRAM_STOPPED, self.program_stopped and self.observing.online)
        found = super().alarms()
        for name, value in list(self.newest_values.items()):
            if quality(value) is Quality.BAD:
                text = Message.of("the point {name} is {status}", name=name, status=status_name(value))
                remedy = translatable("check its I/O module and wiring")
                found.append(Alarm.of(f"bad_{name}", Severity.WARNING, text, remedy, stamp(value)))
        return found

    def identify(self) -> Identity:
        """Read the build information of the server (BuildInfo)."""
        self.observing.check()
        info = self.link.read_standard(BUILD_INFO)
        names = ("ManufacturerName", "ProductName", "SoftwareVersion")
        vendor, model, firmware = (str(getattr(info, name, None) or "") for name in names)
        return Identity(vendor, model, "", firmware)

    # -------------------------------------------------------------------------------- points
    def read(self, name: str) -> Reading[bool | float]:
        """Read a point now, in its unit, with the time stamp of the source and the quality of its status.

        Raises OutOfRange for an unknown name, DeviceFault when the point has no value, Stale while the
        program of the PLC is stopped, NotConnected, ConnectionLost, DeviceTimeout.
        """
        asked = Reading.of(None)
        return self._reading(name, self._value(name), asked.monotonic)

    def newest_value(self, name: str) -> Reading[bool | float]:
        """Return the value of a point that the PLC reported last. It is valid since then while the PLC answers.

        Raises Stale, also while the program of the PLC is stopped, NotConnected, ConnectionLost.
        """
        _, asked, _ = self._polled.current()
        self.check_program()
        found = self.newest_values.get(name)
        if found is None or content(found) is None:
            raise Stale("{device}: the value of {name} is not known yet", device=self.who, name=name)
        return self._reading(name, found, asked)

    def _reading(self, name: str, found: ua.DataValue, asked: float) -> Reading[bool | float]:
        point = self.plc_points[name]
        value = bool(content(found)) if point.digital else float(content(found)) * point.io.scale
        return Reading[bool | float](value, stamp(found), asked, quality(found))

    def _value(self, name: str) -> ua.DataValue:
        self.require_point(name)
        self.observing.check()
        self.check_program()
        (value,) = self.link.read([name])
        if content(value) is None:
            status = status_name(value)
            raise DeviceFault(
                "{device}: {name} has no value: {status}", "", status, device=self.who, name=name, status=status
            )
        return value

    def bad_reading(self, name: str) -> DeviceFault:
        """Return the error for a point whose status is bad."""
        status = status_name(self._value(name))
        return DeviceFault("{device}: {name} is bad: {status}", "", status, device=self.who, name=name, status=status)

    def raw_value(self, name: str, value: float) -> float:
        """Return the value in the type of its node. Raises ValueError with the range."""
        return raw(value, self.io_points[name].scale, self.types.get(name, ua.VariantType.Double))

    def write_raw(self, name: str, raw: bool | float) -> None:
        """Write an output. Raises NotInControl, ConnectionLost, DeviceTimeout."""
        self.send(f"writing {name}", lambda: self.link.write({name: self.variant(name, raw)}))

    def await_point(self, name: str, value: bool, timeout: float) -> None:
        """Return when a digital point has the value."""
        what = f"{name} becoming {'on' if value else 'off'}"
        go_on, edges = self.begin(what), list[Edge]()
        end = self.edge_listeners.add(name, edges.append)
        try:
            found = self._value(name)

            def reached(_: object) -> bool:
                self.check_program()
                newest = self.newest_values.get(name, found)
                present = not is_bad(newest) and bool(content(newest)) is value and stamp(newest) >= stamp(found)
                return present or any(edge.value is value and edge.stamp >= stamp(found) for edge in edges)

            if is_bad(found) or bool(content(found)) is not value:
                self.wait(reached, timeout, what, go_on)
        finally:
            end()

    # -------------------------------------------------------------------------------- actions
    @action(deadline=MAX_WAIT + MARGIN)
    def run_job(self, number: int, timeout: float = 60.0, *, an: str | None = None) -> None:
        """Run a job of the PLC, and return when it is done.

        :param number: number of the job in the program of the PLC
        :param timeout: time limit, s; a job that takes longer is stopped
        """
        assert 0.1 <= timeout <= 600.0

        within(f"{self.who}: timeout", timeout, 0.1, MAX_WAIT)
        self.do_job(number, timeout)
