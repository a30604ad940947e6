"""Generic, GenericWithPose, CollisionObject, VirtualCollisionObject: the base classes of every object type."""

import abc
from collections.abc import Callable
from typing import ClassVar

from arcor2_hw.actions import action
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, LossReaction, Observation, Severity
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.maintenance import DeviceParameter, ParameterFailure
from arcor2_hw.data.object_type import Models
from arcor2_hw.data.parts import PlaceKind
from arcor2_hw.data.points import LivePoint
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2NotImplemented, NotFound
from arcor2_hw.messages import Message
from arcor2_hw.objects.conditions import Conditions, conditions_of
from arcor2_hw.objects.settings import Settings

DEFAULT_CONNECT_TIMEOUT = 5.0
"""Default time limit of `connect`, s. A device on a local network answers within 1 s, a busy controller within 5 s."""


class Generic(abc.ABC):
    """An object in the workplace.

    `__init__` stores its arguments, `connect` opens the connection, `disconnect` closes it. A type written for the
    older convention opens it in `__init__` and closes it in `cleanup`; such a type works unchanged.

    Class Attributes:
        _ABSTRACT: Whether the type cannot be added to a scene.
        loss_reaction: Reaction of the device to a connection loss.
        loss_ends_program: Whether the running program ends when this device is disconnected.
        own_process: Whether instances run in their own process, so that their computations do not delay other devices.
        DYNAMIC_PARAMS: {parameter: (method that returns its values, names of the parameters it needs)}.
        CANCEL_MAPPING: {action: method that cancels it}.
        display_name: Name of the type in the editor, such as "Luxonis OAK-D"; not inherited. Default: the class name.
        category: Category in the editor.
        icon: Icon in the editor.
        place_kind: Kind of place for parts; None if the object holds no parts.
        place_capacity: Maximum number of parts in it; 0: unlimited.
    """

    _ABSTRACT: ClassVar[bool] = True
    DYNAMIC_PARAMS: ClassVar[dict[str, tuple[str, set[str]]]] = {}
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {}
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()
    loss_ends_program: ClassVar[bool] = True
    own_process: ClassVar[bool] = False
    display_name: ClassVar[str] = ""
    category: ClassVar[str] = ""
    icon: ClassVar[str] = ""
    place_kind: PlaceKind | None = None
    place_capacity: ClassVar[int] = 1

    def __init__(self, obj_id: str, name: str, settings: Settings | None = None) -> None:
        self.id = obj_id
        self.name = name
        self._settings = settings

    @property
    def settings(self) -> Settings:
        """Return the settings.

        Raises:
            NotFound: The type has no settings.
        """
        if self._settings is None:
            raise NotFound("{name} has no settings", name=self.name)
        return self._settings

    @classmethod
    def abstract(cls) -> bool:
        """Return whether this type cannot be added to a scene."""
        return cls._ABSTRACT or bool(cls.__abstractmethods__)

    @classmethod
    def description(cls) -> str:
        """Return the first line of the docstring."""
        return (cls.__doc__ or "No description available.").strip().splitlines()[0]

    def scene_object(self) -> SceneObject:
        """Return this object as it is stored in a scene."""
        return SceneObject(self.name, type(self).__name__, id=self.id)

    # -------------------------------------------------------------------------------- connection: optional hooks
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:  # noqa: B027
        """Open the connection for observation only. It does nothing when the connection is open.

        Args:
            timeout: Time limit, s.

        Raises:
            NotConnected: The device cannot be reached; the message names its address.
            DeviceTimeout: The device did not answer in time.
            DeviceFault: The device reports a fault.
        """

    def attach(self, find: "Callable[[str], Generic]") -> None:  # noqa: B027
        """Receive the function that finds other objects of the scene; called once between `__init__` and `connect`.

        Methods of the found object are called on the caller's thread, concurrently with its own actions. Call only
        methods whose type allows that, such as those of `HasPoints`.

        Args:
            find: Returns an object by its name or id. It raises NotFound when the scene has none, and NotConnected
                while the object is not created yet, because all objects are created concurrently.
        """

    def disconnect(self) -> None:  # noqa: B027
        """Close the connection within 1 s. It does nothing when the connection is closed."""

    def cleanup(self) -> None:
        """Close the connection (older name of `disconnect`)."""
        self.disconnect()

    @property
    def connection(self) -> Connection:
        """Return the state of the connection. A type without a connection is always online."""
        return Connection.ONLINE

    @property
    def connection_reason(self) -> str | Message:
        """Return why the connection is lost or failed. Types with an `Observing` connection need not override it."""
        return ""

    @property
    def health(self) -> Health:
        """Return the condition of the device (NAMUR NE 107)."""
        return Health.NORMAL

    @property
    def shown_values(self) -> dict[str, float]:
        """Return the last reported visible state, such as an open door, by name, for displays. It does no I/O.

        Names that the editor draws: `width` of a gripper, m; `gripped`, 1 for a closed gripper; `velocity` of a belt,
        m/s; `door`, 1 when open, 0 when closed, 0.5 in between; `red`, `amber`, `green`, `blue` and `white`, 1 for a
        lit lamp; the digital inputs of an I/O block by their names, 1 when on, which may be sensors that detect parts.
        Round them, because every change is sent to all clients.
        """
        return {}

    def part_present(self) -> bool | None:
        """Return whether a sensor detects a part in the object; None without a sensor. Any thread may call it.

        Raises:
            DeviceError: The sensor cannot be read.
        """
        return None

    def identify(self) -> Identity:
        """Read the identity of the device. It is called after each connection, and must change nothing."""
        raise Arcor2NotImplemented("identify")

    def counters(self) -> dict[str, int]:
        """Read the counters of the device, by name in plain words, such as "labels printed". Change nothing."""
        raise Arcor2NotImplemented("counters")

    def parameters_dump(self) -> list[DeviceParameter]:
        """Read the parameters that the device stores, for a backup. Change nothing.

        Include what a technician has set up and a replacement device of this model needs. Leave out the identity, the
        address, values that the driver writes from its settings, and values that change by themselves.

        Raises:
            DeviceError: The parameters cannot be read.
        """
        raise Arcor2NotImplemented("parameters_dump")

    def parameters_restore(self, parameters: list[DeviceParameter]) -> list[ParameterFailure]:
        """Write parameters of a backup that this model has. Return those that could not be written, with the reason.

        Do not move or enable anything. Write the other parameters if one is unknown or rejected.

        Raises:
            Refused: No parameter can be written in the present state.
            DeviceError: The connection was lost; some parameters may have been written.
        """
        raise Arcor2NotImplemented("parameters_restore")

    def alarms(self) -> list[Alarm]:
        """Return the active alarms. By default they are the conditions reported by `set_condition`."""
        return self.conditions.alarms()

    @property
    def conditions(self) -> Conditions:
        """Return the conditions that this object has reported."""
        return conditions_of(self)

    def set_condition(
        self,
        code: str,
        active: bool,
        text: str | Message = "",
        remedy: str | Message = "",
        severity: Severity = Severity.ERROR,
    ) -> None:
        """Report at once that a condition became active or has ended, from any thread.

        `alarms.toml` next to the driver declares priority, cause and remedy of the code. Text and remedy may be empty
        then.

        Args:
            code: Code of the alarm.
            active: Whether the condition exists.
            text: What happened; a message if it has values.
            remedy: What to do.
            severity: Severity for clients that do not know the declaration.
        """
        self.conditions.set(code, active, text, remedy, severity)

    def observations(self) -> list[Observation]:
        """Return the present values of the device, for display and trends.

        It is called up to ten times per second while a user watches them, on another thread than the actions and also
        while an action runs. Return the newest values instead of waiting for the device.

        Raises:
            DeviceError: No value is known.
        """
        return []

    def live_points(self) -> list[LivePoint]:
        """Return the inputs, outputs and registers of the device with their newest values.

        It is called like `observations`, while a user watches the points. Signals need not be in the list: the values
        of `observations` and of methods marked with `@observation` are added.
        """
        return []

    def force_point(self, name: str, value: bool | float) -> None:
        """Write an output and refuse all other writes to it, until `release_point` is called.

        The cell host takes control before. Only outputs that the device itself switches to a defined state when the
        connection is lost may be forced (`force` of LivePoint), so that no force outlives this process.

        Raises:
            Refused: The point cannot be forced.
            OutOfRange: The value is not allowed.
        """
        raise Arcor2NotImplemented("force_point")

    def release_point(self, name: str, value: bool | float) -> None:
        """End a force: permit other writes, and write the value from before. Another thread may run an action."""
        raise Arcor2NotImplemented("release_point")

    def acknowledge(self, code: str) -> None:
        """Acknowledge the alarm `code`.

        Raises:
            NotFound: No such alarm is active.
        """
        raise NotFound("{name} has no active alarm {code}", name=self.name, code=code)

    # -------------------------------------------------------------------------------- control: optional hooks
    def take_control(self) -> None:  # noqa: B027
        """Take control of the device on a user's command, so that it accepts commands.

        Raises:
            NotInControl: Another client has control; the message names it.
        """

    def release_control(self) -> None:  # noqa: B027
        """Release control. It does nothing without control."""

    def control_owner(self) -> str | None:
        """Return the owner of control: "us", the name of another client, or None."""
        return "us"


class GenericWithPose(Generic):
    """An object with a pose."""

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: Settings | None = None) -> None:
        super().__init__(obj_id, name, settings)
        self._pose = pose

    @property
    def pose(self) -> Pose:
        """Return the pose in the world."""
        return self._pose

    def set_pose(self, pose: Pose) -> None:
        """Set the pose in the world."""
        self._pose = pose

    def scene_object(self) -> SceneObject:
        """Return this object as it is stored in a scene."""
        return SceneObject(self.name, type(self).__name__, self._pose, id=self.id)

    @action
    def update_pose(self, new_pose: Pose, *, an: str | None = None) -> None:
        """Update the object's pose.

        :param new_pose: new pose in the world
        """
        self.set_pose(new_pose)


class CollisionObject(GenericWithPose):
    """An object with a collision model."""

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
        self._enabled_listener: Callable[[], None] = lambda: None

    @property
    def enabled(self) -> bool:
        """Return whether collision checks consider the object."""
        return self._enabled

    @enabled.setter
    def enabled(self, value: bool) -> None:
        self._enabled = value
        self._enabled_listener()

    def on_enabled_changed(self, listener: Callable[[], None]) -> None:
        """Register a function that is called, on any thread, when the object is enabled or disabled."""
        self._enabled_listener = listener

    @action
    def set_enabled(self, state: bool, *, an: str | None = None) -> None:
        """Enable or disable the object in collision checks.

        :param state: false while something may pass through the object
        """
        self.enabled = state


class VirtualCollisionObject(CollisionObject):
    """A collision model without a device, such as a table, a wall or a zone."""

    _ABSTRACT = True
