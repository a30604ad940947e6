"""The smaller base classes: Gripper, Suction, IOBlock, Axis, Reader, Scale, Printer."""

import abc
import enum
from collections.abc import Callable
from typing import ClassVar, Final, Literal, NamedTuple, Protocol, runtime_checkable

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.device import LossReaction, Observation, Quality, Reading
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.points import ForceKind, LivePoint, PointQuality, PointUse
from arcor2_hw.exceptions import (
    Arcor2NotImplemented,
    ConnectionLost,
    DeviceError,
    DeviceFault,
    NotConnected,
    Refused,
    Stale,
)
from arcor2_hw.messages import translatable
from arcor2_hw.objects.generic import Generic
from arcor2_hw.objects.gripping import HoldsParts

MAX_POINTS: Final = 32
"""Maximum number of points of an IOBlock among its observations."""


class GripperState(enum.StrEnum):
    """State of a gripper."""

    INACTIVE = "inactive"
    MOVING = "moving"
    AT_POSITION = "at_position"
    HOLDING = "holding"
    LOST = "lost"


class GripResult(NamedTuple):
    """Result of a grip: whether a part is held, and the width between the fingers, m."""

    held: bool
    width: float


class Gripper(HoldsParts, Generic):
    """A gripper with fingers; it keeps its grip when the connection is lost.

    Attributes:
        tcp: Tool centre point of the closed gripper in the frame of the flange; of the class or of an object.
        mass: Mass, kg; of the class or of an object.
    """

    category: ClassVar[str] = "Grippers"
    icon: ClassVar[str] = "gripper"
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()
    tcp: Pose
    mass: float

    @abc.abstractmethod
    def activate(self) -> None:
        """Activate the gripper; it may open and close once."""

    @abc.abstractmethod
    def grip(self, width: float, force: float, speed: float) -> tuple[bool, float]:
        """Close the fingers, and return a GripResult when a part is held or the width is reached.

        Args:
            width: Width, m.
            force: Force, N.
            speed: Speed, m/s.
        """

    @abc.abstractmethod
    def release(self) -> None:
        """Open fully."""

    @abc.abstractmethod
    def state(self) -> GripperState:
        """Return the present state."""


class Suction(HoldsParts, Generic):
    """A suction cup."""

    category: ClassVar[str] = "Grippers"
    icon: ClassVar[str] = "suction"
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()

    @abc.abstractmethod
    def on(self) -> None:
        """Switch the vacuum on."""

    @abc.abstractmethod
    def off(self) -> None:
        """Switch the vacuum off."""

    @abc.abstractmethod
    def part_held(self) -> bool:
        """Return whether a part is held."""

    def blow_off(self) -> None:
        """Blow the part off."""
        raise Arcor2NotImplemented("blow_off")

    def vacuum(self) -> Reading[float]:
        """Return the vacuum below ambient pressure, Pa."""
        raise Arcor2NotImplemented("vacuum")

    def observations(self) -> list[Observation]:
        """Return the vacuum if it is measured."""
        try:
            return [Observation.of(translatable("Vacuum"), self.vacuum(), "Pa")]
        except (Arcor2NotImplemented, Refused):
            return []


class PointKind(enum.StrEnum):
    """Whether a point is digital or analogue."""

    DIGITAL = "digital"
    ANALOG = "analog"


class PointDirection(enum.StrEnum):
    """Direction as seen from the controller."""

    INPUT = "input"
    OUTPUT = "output"


class OnLoss(enum.StrEnum):
    """Reaction of an output to a connection loss of the device."""

    HOLD = "hold"
    OFF = "off"
    ON = "on"


class IOPoint(Data, frozen=True):
    """A named input or output. Its physical value is the raw value times `scale`; `debounce` is in s."""

    name: str
    direction: PointDirection
    kind: PointKind
    unit: str = ""
    scale: float = 1.0
    debounce: float = 0.0
    on_loss: OnLoss | Unset = UNSET

    @property
    def forcible(self) -> bool:
        """Whether it may be forced: an output whose force ends at the device if this computer fails."""
        return self.direction is PointDirection.OUTPUT and self.on_loss in (OnLoss.OFF, OnLoss.ON)


def live_point(point: IOPoint, read: Callable[[str], Reading[bool | float]], *, can_force: bool = False) -> LivePoint:
    """Return a point with its value.

    Args:
        point: The point.
        read: Returns the newest value of a point.
        can_force: Whether the device implements `force_point`.
    """
    found = LivePoint(point.name, PointUse(point.direction.value), unit=point.unit)
    if can_force and point.forcible:
        found = replace(found, force=ForceKind(point.kind.value))
    try:
        reading = read(point.name)
    except DeviceError as error:
        return replace(found, quality=quality_of(error))
    bad = reading.quality is Quality.BAD
    return replace(
        found,
        value=None if bad else reading.value,
        quality=PointQuality(reading.quality.value),
        age=round(reading.age, 3),
    )


def quality_of(error: Exception) -> PointQuality:
    """Return the quality of a point that could not be read."""
    if isinstance(error, Stale):
        return PointQuality.STALE
    return PointQuality.NOT_CONNECTED if isinstance(error, NotConnected | ConnectionLost) else PointQuality.BAD


@runtime_checkable
class HasPoints(Protocol):
    """Named inputs and outputs that other objects may use (`Generic.attach`), such as those of an IOBlock or a robot.

    All methods may be called from any thread, also while the object executes an action.
    """

    def points(self) -> list[IOPoint]:
        """Return the points."""

    def read(self, name: str) -> Reading[bool | float]:
        """Read a point.

        Raises:
            OutOfRange: The point does not exist.
            Stale: No recent value is known.
            ConnectionLost: The connection is lost.
            DeviceTimeout: The device did not answer in time.
        """

    def write(self, name: str, value: bool | float) -> None:
        """Write an output.

        Raises:
            Refused: The point is an input.
            NotInControl: Another client has control.
            ConnectionLost: The connection is lost.
            DeviceTimeout: The device did not answer in time.
        """


class IOBlock(Generic):
    """A block of named inputs and outputs."""

    category: ClassVar[str] = "Inputs and outputs"
    icon: ClassVar[str] = "io"

    @abc.abstractmethod
    def points(self) -> list[IOPoint]:
        """Return the points."""

    @abc.abstractmethod
    def read(self, name: str) -> Reading[bool | float]:
        """Read a point."""

    def observations(self) -> list[Observation]:
        """Return the first MAX_POINTS points. A point that cannot be read has bad quality."""
        return [self._observation(point) for point in self.points()[:MAX_POINTS]]

    def newest_value(self, name: str) -> Reading[bool | float]:
        """Return the newest value of a point without asking the device, if that is possible. Raises like `read`."""
        return self.read(name)

    def live_points(self) -> list[LivePoint]:
        """Return the points with their newest values."""
        return [live_point(point, self.newest_value) for point in self.points()]

    def _observation(self, point: IOPoint) -> Observation:
        try:
            return Observation.of(point.name, self.read(point.name), point.unit)
        except (DeviceFault, Stale):
            return Observation(point.name, None, point.unit, Quality.BAD)

    @abc.abstractmethod
    def write(self, name: str, value: bool | float) -> None:
        """Write an output.

        Raises:
            Refused: The point is an input.
        """

    def pulse(self, name: str, duration: float) -> None:
        """Switch a digital output on for `duration` s."""
        raise Arcor2NotImplemented("pulse")

    def wait_for(self, name: str, value: bool, timeout: float) -> None:
        """Wait until a digital point has the value.

        Raises:
            DeviceTimeout: It does not have it within `timeout` s.
        """
        raise Arcor2NotImplemented("wait_for")


class Axis(Generic):
    """A single driven axis.

    Class Attributes:
        position_unit: Unit of positions, m or rad.
    """

    position_unit: ClassVar[str] = "m"
    category: ClassVar[str] = "Axes"
    icon: ClassVar[str] = "axis"

    @abc.abstractmethod
    def home(self) -> None:
        """Move the axis to its reference."""

    @abc.abstractmethod
    def move_absolute(self, position: float, velocity: float) -> None:
        """Move to a position.

        Raises:
            Refused: The axis is not referenced.
        """

    @abc.abstractmethod
    def move_relative(self, distance: float, velocity: float) -> None:
        """Move by a distance."""

    @abc.abstractmethod
    def move_velocity(self, velocity: float) -> None:
        """Move with a velocity until stopped."""

    @abc.abstractmethod
    def halt(self) -> None:
        """Decelerate to standstill."""

    @abc.abstractmethod
    def quick_stop(self) -> None:
        """Decelerate to standstill with the emergency deceleration."""

    @abc.abstractmethod
    def fault_reset(self) -> None:
        """Acknowledge a fault."""

    @abc.abstractmethod
    def position(self) -> Reading[float]:
        """Return the present position."""

    @abc.abstractmethod
    def velocity(self) -> Reading[float]:
        """Return the present velocity."""

    def observations(self) -> list[Observation]:
        """Return position and velocity."""
        return [
            Observation.of(translatable("Position"), self.position(), self.position_unit),
            Observation.of(translatable("Velocity"), self.velocity(), f"{self.position_unit}/s"),
        ]


class Code(Data, frozen=True):
    """A code that was read."""

    text: str


class NoRead(Data, frozen=True):
    """No code was read in time."""

    reason: Literal["timeout", "unreadable"] = "timeout"


class Reader(Generic):
    """A reader of codes. A code is consumed once."""

    category: ClassVar[str] = "Identification"
    icon: ClassVar[str] = "reader"

    @abc.abstractmethod
    def trigger(self, timeout: float) -> Code | NoRead:
        """Read one code within `timeout` s. Codes read before the call are discarded."""


class Scale(Generic):
    """A scale."""

    category: ClassVar[str] = "Measuring"
    icon: ClassVar[str] = "scale"

    @abc.abstractmethod
    def weigh(self, stable: bool = True) -> Reading[float]:
        """Return the weight, kg; with `stable`, wait until it is stable."""

    @abc.abstractmethod
    def tare(self) -> None:
        """Use the present weight as the tare."""

    @abc.abstractmethod
    def zero(self) -> None:
        """Set the present weight to zero."""


class Printer(Generic):
    """A label printer. A label is never sent again automatically."""

    category: ClassVar[str] = "Printers"
    icon: ClassVar[str] = "printer"

    @abc.abstractmethod
    def print(self, label: str) -> str:
        """Print a label and return the id of the job."""

    @abc.abstractmethod
    def status(self) -> str:
        """Return the state of the printer."""

    @abc.abstractmethod
    def counter(self) -> int:
        """Return the number of labels printed."""


# Names before version 0.2.
MOST_POINTS = MAX_POINTS
