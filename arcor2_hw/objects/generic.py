"""Generic, GenericWithPose, CollisionObject, VirtualCollisionObject: what every object type is."""

import abc
from collections.abc import Callable
from typing import ClassVar

from arcor2_hw.actions import action
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2NotImplemented, NotFound
from arcor2_hw.objects.settings import Settings

DEFAULT_CONNECT_TIMEOUT = 5.0
"""Seconds. A device on a local network answers within one; five allow for a controller that is busy."""


class Generic(abc.ABC):
    """An object in the workplace.

    `__init__` stores, `connect` opens, `disconnect` closes. A type written for the older convention opens in
    `__init__` and closes in `cleanup`; it works as it is.

    Class data: `_ABSTRACT` (may it not be placed in a scene), `loss_reaction` (what the device does when it loses us),
    `loss_ends_program` (a program that runs is stopped when this device is lost; false where work may go on without),
    `DYNAMIC_PARAMS` {parameter: (method giving its values, names of the parameters it needs)}, `CANCEL_MAPPING`
    {action: method that cancels it}, `category` and `icon` for the editor.
    """

    _ABSTRACT: ClassVar[bool] = True
    DYNAMIC_PARAMS: ClassVar[dict[str, tuple[str, set[str]]]] = {}
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {}
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()
    loss_ends_program: ClassVar[bool] = True
    category: ClassVar[str] = ""
    icon: ClassVar[str] = ""

    def __init__(self, obj_id: str, name: str, settings: Settings | None = None) -> None:
        self.id = obj_id
        self.name = name
        self._settings = settings

    @property
    def settings(self) -> Settings:
        """Give the settings; NotFound when the type has none."""
        if self._settings is None:
            raise NotFound(f"{self.name} has no settings")
        return self._settings

    @classmethod
    def abstract(cls) -> bool:
        """Tell whether this type may not be placed in a scene."""
        return cls._ABSTRACT or bool(cls.__abstractmethods__)

    @classmethod
    def description(cls) -> str:
        """Give the first line of the docstring."""
        return (cls.__doc__ or "No description available.").strip().splitlines()[0]

    def scene_object(self) -> SceneObject:
        """Give this object as it stands in a scene."""
        return SceneObject(self.name, type(self).__name__, id=self.id)

    # -------------------------------------------------------------------------------- connection: optional hooks
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:  # noqa: B027
        """Open the connection within `timeout` seconds, to observe only; harmless when it is open.

        Raises NotConnected naming the address, DeviceTimeout, DeviceFault.
        """

    def attach(self, find: "Callable[[str], Generic]") -> None:  # noqa: B027
        """Take the way to the other objects of the scene; called once, between `__init__` and `connect`.

        `find` gives an object by its name or id. It raises NotFound when the scene has none, NotConnected while it is
        not made yet: all come up at once. A method is called there on the caller's thread, beside what the object is
        doing; so only what its type declares for that may be called, as `HasPoints` does.
        """

    def disconnect(self) -> None:  # noqa: B027
        """Close the connection; harmless when it is closed. Takes no longer than 1 s."""

    def cleanup(self) -> None:
        """Close everything (the older name of disconnect)."""
        self.disconnect()

    @property
    def connection(self) -> Connection:
        """Tell how the connection is; a type without one is always online."""
        return Connection.ONLINE

    @property
    def connection_reason(self) -> str:
        """Tell why the connection is lost or failed; for types that do not keep it by `Observing`, which is asked."""
        return ""

    @property
    def health(self) -> Health:
        """Give the condition of the device (NAMUR NE 107)."""
        return Health.NORMAL

    def identify(self) -> Identity:
        """Ask the device who it is."""
        raise Arcor2NotImplemented("identify")

    def alarms(self) -> list[Alarm]:
        """Give what a person should deal with now."""
        return []

    def acknowledge(self, code: str) -> None:
        """Acknowledge the alarm `code`; NotFound when it does not stand."""
        raise NotFound(f"{self.name} has no alarm {code}")

    # -------------------------------------------------------------------------------- control: optional hooks
    def take_control(self) -> None:  # noqa: B027
        """Take control, so that commands are obeyed; an act of its own, done on a person's command.

        Raises NotInControl naming who has it.
        """

    def release_control(self) -> None:  # noqa: B027
        """Give control back; harmless when it is not ours."""

    def control_owner(self) -> str | None:
        """Tell who has control: "us", another's name, or None when nobody has."""
        return "us"


class GenericWithPose(Generic):
    """An object that stands somewhere."""

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: Settings | None = None) -> None:
        super().__init__(obj_id, name, settings)
        self._pose = pose

    @property
    def pose(self) -> Pose:
        """Give where it stands, in the world."""
        return self._pose

    def set_pose(self, pose: Pose) -> None:
        """Tell it that it stands elsewhere."""
        self._pose = pose

    def scene_object(self) -> SceneObject:
        """Give this object as it stands in a scene."""
        return SceneObject(self.name, type(self).__name__, self._pose, id=self.id)

    @action
    def update_pose(self, new_pose: Pose, *, an: str | None = None) -> None:
        """Tell the program that the object stands elsewhere.

        :param new_pose: where it stands now
        """
        self.set_pose(new_pose)


class CollisionObject(GenericWithPose):
    """An object that other things must not run into."""

    category: ClassVar[str] = "Collision objects"
    icon: ClassVar[str] = "solid"
    mesh_filename: ClassVar[str | None] = None

    def __init__(
        self,
        obj_id: str,
        name: str,
        pose: Pose,
        collision_model: Models | None = None,
        settings: Settings | None = None,
    ) -> None:
        super().__init__(obj_id, name, pose, settings)
        self.collision_model = collision_model
        self._enabled = True
        self._told: Callable[[], None] = lambda: None

    @property
    def enabled(self) -> bool:
        """Tell whether it counts in collision checks."""
        return self._enabled

    @enabled.setter
    def enabled(self, value: bool) -> None:
        self._enabled = value
        self._told()

    def tell_enabled(self, listener: Callable[[], None]) -> None:
        """Have `listener` called, on whatever thread, when it comes to count in collision checks, or no longer does."""
        self._told = listener

    @action
    def set_enabled(self, state: bool, *, an: str | None = None) -> None:
        """Say whether the object counts in collision checks.

        :param state: false while something may pass through it
        """
        self.enabled = state


class VirtualCollisionObject(CollisionObject):
    """A collision model with no device behind it: a table, a wall, a zone."""

    _ABSTRACT = True
