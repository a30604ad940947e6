"""What is known of the devices that a cell host holds: connection, health, alarms, control."""

from collections.abc import Iterable

from arcor2_hw.data.base import Data
from arcor2_hw.data.device import Alarm, Connection, Health
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.runtime.messages import DeviceChanged


class DeviceStatus(Data, frozen=True):
    """One object of the scene in operation; `answering` is false while its cell host is silent."""

    id: str
    name: str
    type: str
    connection: Connection
    health: Health
    alarms: list[Alarm]
    control_owner: str | None
    answering: bool = True


class DeviceBoard:
    """Keeps the newest word of each device."""

    def __init__(self) -> None:
        self._objects: dict[str, SceneObject] = {}
        self._said: dict[str, DeviceChanged] = {}
        self.answering = True

    def clear(self) -> None:
        """Begin anew."""
        self._objects.clear()
        self._said.clear()
        self.answering = True

    def show(self, objects: Iterable[SceneObject]) -> None:
        """Take the objects of a scene; those that have said nothing yet are offline."""
        self._objects = {obj.id: obj for obj in objects}

    def changed(self, message: DeviceChanged) -> None:
        """Take what a device says."""
        self._said[message.object_id] = message

    def statuses(self) -> list[DeviceStatus]:
        """Give all objects in the order of the scene."""
        found = []
        for obj in self._objects.values():
            said = self._said.get(obj.id) or DeviceChanged(obj.id, Connection.OFFLINE, Health.NORMAL)
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
                )
            )
        return found
