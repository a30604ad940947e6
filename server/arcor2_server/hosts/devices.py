"""What is known of the devices that a cell host holds: connection, health, alarms, control."""

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

import msgspec
import structlog

from arcor2_hw.data.base import UNSET, Data
from arcor2_hw.data.cell import overlay, strangers
from arcor2_hw.data.device import Alarm, Connection, Health
from arcor2_hw.data.events import ObjectStateData
from arcor2_hw.data.operation import ObjectHealthData
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride
from arcor2_hw.data.secret import HIDDEN
from arcor2_hw.exceptions import NotFound
from arcor2_hw.runtime.messages import DeviceChanged, HeldPart
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event

if TYPE_CHECKING:
    from arcor2_server.services import Services

log = structlog.get_logger(__name__)


class DeviceStatus(Data, frozen=True):
    """One object of the scene in operation; `answering` is false while its cell host is silent.

    reason: why the connection is lost. overlaid: the settings that come from the server's cell file.
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


def overlay_for(services: "Services", scene: Scene) -> tuple[list[SceneObjectOverride], dict[str, list[str]]]:
    """Return what the server's cell file lays over a scene, and the names of these settings by object; logged.

    Raises InvalidData naming the object whose type is another one.
    """
    cell = services.settings.cell
    if cell is None:
        return [], {}
    overrides = overlay(cell, scene)
    objects = {scene_object.id: scene_object for scene_object in scene.objects}
    for override in overrides:
        of, secret = objects[override.id], services.secrets.is_secret
        laid = {each.name: HIDDEN if secret(of.type, each.name) else each.value for each in override.parameters}
        log.info("settings from the cell file", object=of.name, settings=laid)
    if unknown := strangers(cell, scene):
        log.warning("the cell file names what is not in the scene", objects=unknown, scene=scene.name)
    return overrides, {override.id: [parameter.name for parameter in override.parameters] for override in overrides}


class DeviceBoard:
    """Keeps the newest word of each device, and tells clients each change of a connection or of health, once.

    told: called after a change of a connection was told.
    """

    def __init__(self, hub: EventHub, told: Callable[[], None] = lambda: None) -> None:
        self.on_obstacles_changed: list[Callable[[], None]] = []
        """Called when a collision object was enabled or disabled, or a robot gripped or released a part."""
        self._hub = hub
        self._told = told
        self._overlaid: Mapping[str, list[str]] = {}
        self._objects: dict[str, SceneObject] = {}
        self._said: dict[str, DeviceChanged] = {}
        self.answering = True

    def _tell(self, data: ObjectStateData) -> None:
        self._hub.broadcast(make_event("ObjectState", data))
        self._told()

    def set_answering(self, answering: bool) -> None:
        """Note whether the process that controls the devices answers, and publish it with the state of each device."""
        if self.answering == answering:
            return
        self.answering = answering
        for state in self.states():
            self._tell(state)

    def clear(self, reason: str = "") -> None:
        """Begin anew: what was connected is offline now, for a reason."""
        before, self._said = self._said, {}
        for said in before.values():
            if said.connection is not Connection.OFFLINE:
                self._tell(ObjectStateData(said.object_id, Connection.OFFLINE, reason or UNSET))
        if any(_obstacles(said) != _obstacles(None) for said in before.values()):
            self._notify_obstacles()
        self._objects.clear()
        self._overlaid = {}
        self.answering = True

    def _notify_obstacles(self) -> None:
        for notify in self.on_obstacles_changed:
            notify()

    def show(self, objects: Iterable[SceneObject], overlaid: Mapping[str, list[str]]) -> None:
        """Take the objects of a scene; those that have said nothing yet are offline.

        overlaid: by id, the settings that come from the server's cell file.
        """
        self._objects = {obj.id: obj for obj in objects}
        self._overlaid = overlaid

    def object(self, object_id: str) -> SceneObject:
        """Give an object of the scene that is shown; NotFound."""
        if (found := self._objects.get(object_id)) is None:
            raise NotFound(f"There is no object {object_id!r} in operation.")
        return found

    def changed(self, message: DeviceChanged) -> None:
        """Take what a device says."""
        before = self._said.get(message.object_id)
        self._said[message.object_id] = message
        if before is None or before.connection is not message.connection:
            self._tell(self._state(message))
        if before is None or _health(before) != _health(message):
            self._hub.broadcast(make_event("ObjectHealth", _health(message)))
        if _obstacles(before) != _obstacles(message):
            self._notify_obstacles()

    def healths(self) -> list[ObjectHealthData]:
        """Give the health of every object, in the order of the scene."""
        return [_health(self._word(object_id)) for object_id in self._objects]

    def failed(self) -> list[str]:
        """Name the objects that have failed, in the order of the scene."""
        return [one.name for one in self._objects.values() if self._word(one.id).connection is Connection.FAILED]

    def require_not_failed(self, object_id: str) -> None:
        """RequestRefused when an object has failed, with its name and why."""
        said, known = self._said.get(object_id), self._objects.get(object_id)
        if said is not None and known is not None and said.connection is Connection.FAILED:
            raise RequestRefused(f"{known.name} is not there: {said.reason or 'it could not be connected'}.")

    def states(self) -> list[ObjectStateData]:
        """Give the connection of every object, in the order of the scene."""
        return [self._state(self._word(object_id)) for object_id in self._objects]

    def not_in_the_way(self) -> frozenset[str]:
        """Give the collision objects that do not count for now."""
        return frozenset(said.object_id for said in self._said.values() if not said.in_the_way)

    def held_parts(self) -> dict[str, tuple[str, HeldPart]]:
        """Return the parts that robots hold, by name, each with the id of its robot."""
        return {part.name: (said.object_id, part) for said in self._said.values() for part in said.held}

    def _word(self, object_id: str) -> DeviceChanged:
        return self._said.get(object_id) or DeviceChanged(object_id, Connection.OFFLINE, Health.NORMAL)

    def _state(self, said: DeviceChanged) -> ObjectStateData:
        overlaid = self._overlaid.get(said.object_id)
        answering = UNSET if self.answering else False
        return ObjectStateData(said.object_id, said.connection, said.reason or UNSET, overlaid or UNSET, answering)

    def statuses(self) -> list[DeviceStatus]:
        """Give all objects in the order of the scene."""
        found = []
        for obj in self._objects.values():
            said = self._word(obj.id)
            found.append(
                DeviceStatus(
                    obj.id,
                    obj.name,
                    obj.type,
                    said.connection,
                    said.health,
                    said.alarms,
                    said.control_owner,
                    self.answering,
                    said.reason,
                    list(self._overlaid.get(obj.id, ())),
                )
            )
        return found


def _obstacles(said: DeviceChanged | None) -> tuple[bool, list[HeldPart]]:
    """Return what a device contributes to the obstacles: whether it counts, and the parts that it holds."""
    return (True, []) if said is None else (said.in_the_way, said.held)


def _health(said: DeviceChanged) -> ObjectHealthData:
    return ObjectHealthData(said.object_id, said.health, said.alarms, said.control_owner or UNSET)
