"""The states of the devices of a cell host: connection, health, alarms and control."""

from collections.abc import Callable, Iterable, Mapping

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Data
from arcor2_hw.data.cell import Cell, overlay, unknown_objects
from arcor2_hw.data.device import Alarm, Connection, Health
from arcor2_hw.data.events import ObjectStateData
from arcor2_hw.data.interlocks import InterlockState, InterlockStates
from arcor2_hw.data.operation import CarriedPart, ObjectHealthData, ObjectValuesData
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride
from arcor2_hw.data.secret import HIDDEN
from arcor2_hw.exceptions import NotFound
from arcor2_hw.messages import Message
from arcor2_hw.runtime.messages import DeviceChanged, DeviceIdentified, HeldPart
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event

log = structlog.get_logger(__name__)


class DeviceStatus(Data, frozen=True):
    """The state of an object of the scene.

    Args:
        id: id of the scene object.
        name: its name.
        type: its object type.
        connection: state of its connection.
        health: its health.
        alarms: its active alarms.
        control_owner: who has control of the device, None if unknown.
        answering: false while the cell host does not answer.
        reason: why the connection is lost.
        overlaid: names of the settings that the cell file of the server overrides.
    """

    id: str
    name: str
    type: str
    connection: Connection
    health: Health
    alarms: list[Alarm]
    control_owner: str | None
    answering: bool = True
    reason: str = ""
    overlaid: list[str] = msgspec.field(default_factory=list)


def overlay_for(
    cell: Cell | None, is_secret: Callable[[str, str], bool], scene: Scene
) -> tuple[list[SceneObjectOverride], dict[str, list[str]]]:
    """Return the settings that the cell file overrides in a scene, and the names of these settings by object.

    Args:
        cell: the cell file of the server, if there is one.
        is_secret: returns whether the setting of a type is secret. Secret values are not logged.
        scene: the scene.

    Raises:
        InvalidData: an object has another type in the cell file.
    """
    if cell is None:
        return [], {}
    overrides = overlay(cell, scene)
    objects = {scene_object.id: scene_object for scene_object in scene.objects}
    for override in overrides:
        of = objects[override.id]
        laid = {each.name: HIDDEN if is_secret(of.type, each.name) else each.value for each in override.parameters}
        log.info("cell file overrides settings", object=of.name, settings=laid)
    if unknown := unknown_objects(cell, scene):
        log.warning("objects of the cell file are not in the scene", objects=unknown, scene=scene.name)
    return overrides, {override.id: [parameter.name for parameter in override.parameters] for override in overrides}


class DeviceBoard:
    """Stores the last report of each device and publishes changes of connection and health."""

    def __init__(self, hub: EventHub) -> None:
        self.on_connection: list[Callable[[], None]] = []
        """Called after each change of a connection."""
        self.on_obstacles_changed: list[Callable[[], None]] = []
        """Called when a collision object was enabled or disabled, or a robot gripped or released a part."""
        self.on_report: list[Callable[[DeviceChanged], None]] = []
        """Called with each report of a device, and with the last reports again when the objects are known."""
        self.on_clear: list[Callable[[list[str]], None]] = []
        """Called with the ids of the objects that are no longer observed."""
        self.on_identified: list[Callable[[DeviceIdentified], None]] = []
        """Called with the identity of a device, each time after it connected."""
        self._hub = hub
        self._overlaid: Mapping[str, list[str]] = {}
        self._objects: dict[str, SceneObject] = {}
        self._reports: dict[str, DeviceChanged] = {}
        self.answering = True
        self.interlocks: list[InterlockState] = []
        """The states of the interlocks; none while they are unknown."""

    def _publish(self, data: ObjectStateData) -> None:
        self._hub.broadcast(make_event("ObjectState", data))
        for notify in self.on_connection:
            notify()

    def set_answering(self, answering: bool) -> None:
        """Store whether the cell host answers, and publish it with the state of each device."""
        if self.answering == answering:
            return
        self.answering = answering
        for state in self.states():
            self._publish(state)

    def clear(self, reason: Message | None = None) -> None:
        """Remove all devices, and publish those that were connected as offline with a reason."""
        before, self._reports = self._reports, {}
        for forget in self.on_clear:
            forget(list(before))
        for report in before.values():
            if report.connection is not Connection.OFFLINE:
                self._publish(_state(report.object_id, Connection.OFFLINE, reason))
        if any(_obstacles(report) != _obstacles(None) for report in before.values()):
            self._notify_obstacles()
        self._objects.clear()
        self._overlaid = {}
        self.answering = True
        if self.interlocks:
            self.interlocks_changed([])

    def _notify_obstacles(self) -> None:
        for notify in self.on_obstacles_changed:
            notify()

    def show(self, objects: Iterable[SceneObject], overlaid: Mapping[str, list[str]]) -> None:
        """Set the objects of the scene. Objects without a report are offline.

        Args:
            objects: the objects.
            overlaid: names of the settings that the cell file of the server overrides, by id of the object.
        """
        self._objects = {obj.id: obj for obj in objects}
        self._overlaid = overlaid
        for report in self._reports.values():
            self._notify_report(report)

    def _notify_report(self, report: DeviceChanged) -> None:
        for notify in self.on_report:
            notify(report)

    def add(self, obj: SceneObject, overlaid: list[str]) -> None:
        """Add an object, and the names of its settings that the cell file overrides."""
        self.show([*self._objects.values(), obj], {**self._overlaid, obj.id: overlaid})

    def object(self, object_id: str) -> SceneObject:
        """Return an object of the scene. Raise NotFound if there is none."""
        if (found := self._objects.get(object_id)) is None:
            raise NotFound("No object with the id {object_id!r} is online.", object_id=object_id)
        return found

    def changed(self, message: DeviceChanged) -> None:
        """Handle the report of a device."""
        before = self._reports.get(message.object_id)
        self._reports[message.object_id] = message
        if before is None or before.connection is not message.connection:
            self._publish(self._state(message))
        if before is None or _health(before) != _health(message):
            self._hub.broadcast(make_event("ObjectHealth", _health(message)))
        if before is None or _values(before) != _values(message):
            self._hub.broadcast(make_event("ObjectValues", _values(message)))
        if _obstacles(before) != _obstacles(message):
            self._notify_obstacles()
        self._notify_report(message)

    def identified(self, message: DeviceIdentified) -> None:
        """Handle the identity of a device."""
        for notify in self.on_identified:
            notify(message)

    def interlocks_changed(self, states: list[InterlockState]) -> None:
        """Handle the states of the interlocks from the cell host."""
        self.interlocks = states
        self._hub.broadcast(make_event("InterlockStates", InterlockStates(states)))

    def healths(self) -> list[ObjectHealthData]:
        """Return the health of every object, in the order of the scene."""
        return [_health(self._report(object_id)) for object_id in self._objects]

    def values(self) -> list[ObjectValuesData]:
        """Return the shown values and carried parts of every object, in the order of the scene."""
        return [_values(self._report(object_id)) for object_id in self._objects]

    def failed(self) -> list[str]:
        """Return the names of the objects that failed to connect, in the order of the scene."""
        return [obj.name for obj in self._objects.values() if self._report(obj.id).connection is Connection.FAILED]

    def require_not_failed(self, object_id: str) -> None:
        """Raise RequestRefused, with name and reason, if an object failed to connect."""
        report, known = self._reports.get(object_id), self._objects.get(object_id)
        if report is not None and known is not None and report.connection is Connection.FAILED:
            reason = report.reason or Message.of("the connection failed")
            raise RequestRefused("{name} is not connected: {reason}.", name=known.name, reason=reason)

    def states(self) -> list[ObjectStateData]:
        """Return the connection of every object, in the order of the scene."""
        return [self._state(self._report(object_id)) for object_id in self._objects]

    def disabled_obstacles(self) -> frozenset[str]:
        """Return the ids of the collision objects that are disabled."""
        return frozenset(report.object_id for report in self._reports.values() if not report.in_the_way)

    def held_parts(self) -> dict[str, tuple[str, HeldPart]]:
        """Return the gripped parts by name, each with the id of its robot."""
        return {part.name: (report.object_id, part) for report in self._reports.values() for part in report.held}

    @property
    def reports(self) -> Mapping[str, DeviceChanged]:
        """The last reports by object."""
        return self._reports

    def _report(self, object_id: str) -> DeviceChanged:
        return self._reports.get(object_id) or DeviceChanged(object_id, Connection.OFFLINE, Health.NORMAL)

    def _state(self, report: DeviceChanged) -> ObjectStateData:
        state = _state(report.object_id, report.connection, report.reason)
        overlaid = self._overlaid.get(report.object_id)
        return replace(state, overlaid=overlaid or UNSET, answering=UNSET if self.answering else False)

    def statuses(self) -> list[DeviceStatus]:
        """Return the states of all objects, in the order of the scene."""
        return [
            DeviceStatus(
                obj.id,
                obj.name,
                obj.type,
                report.connection,
                report.health,
                report.alarms,
                report.control_owner,
                self.answering,
                str(report.reason or ""),
                list(self._overlaid.get(obj.id, ())),
            )
            for obj in self._objects.values()
            for report in (self._report(obj.id),)
        ]


def _state(object_id: str, connection: Connection, reason: Message | None) -> ObjectStateData:
    if reason is None:
        return ObjectStateData(object_id, connection)
    return ObjectStateData(object_id, connection, reason.text, **reason.translation())


def _obstacles(report: DeviceChanged | None) -> tuple[bool, list[HeldPart]]:
    """Return whether a device is an obstacle, and the parts that it holds."""
    return (True, []) if report is None else (report.in_the_way, report.held)


def _health(report: DeviceChanged) -> ObjectHealthData:
    return ObjectHealthData(report.object_id, report.health, report.alarms, report.control_owner or UNSET)


def _values(report: DeviceChanged) -> ObjectValuesData:
    parts = [CarriedPart(part.name, part.link, part.pose, part.model or UNSET) for part in report.held]
    return ObjectValuesData(report.object_id, report.values, parts)
