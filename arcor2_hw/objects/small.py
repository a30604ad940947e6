"""The smaller bases: Gripper, Suction, IOBlock, Axis, Reader, Scale, Printer."""

import abc
import enum
from typing import ClassVar, Literal, NamedTuple, Protocol, runtime_checkable

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.device import LossReaction, Reading
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import Arcor2NotImplemented
from arcor2_hw.objects.generic import Generic
from arcor2_hw.objects.gripping import HoldsParts


class GripperState(enum.StrEnum):
    """What a gripper is doing."""

    INACTIVE = "inactive"
    MOVING = "moving"
    AT_POSITION = "at_position"
    HOLDING = "holding"
    LOST = "lost"


class GripResult(NamedTuple):
    """What a grip came to: whether something is held, and the width between the fingers, m."""

    held: bool
    width: float


class Gripper(HoldsParts, Generic):
    """A gripper with fingers; it keeps its grip when the connection is lost.

    tcp: its tool centre point, closed, in the flange. mass: kg. Both of the class, or of an object whose settings say
    which model it is.
    """

    category: ClassVar[str] = "Grippers"
    icon: ClassVar[str] = "gripper"
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()
    tcp: Pose
    mass: float

    @abc.abstractmethod
    def activate(self) -> None:
        """Make it ready; it may open and close once."""

    @abc.abstractmethod
    def grip(self, width: float, force: float, speed: float) -> tuple[bool, float]:
        """Close to `width` m with `force` N at `speed` m/s; return when it holds or has arrived: a GripResult."""

    @abc.abstractmethod
    def release(self) -> None:
        """Open fully."""

    @abc.abstractmethod
    def state(self) -> GripperState:
        """Tell what it is doing."""


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
        """Tell whether a part is held."""

    def blow_off(self) -> None:
        """Push the part off with a blast of air."""
        raise Arcor2NotImplemented("blow_off")

    def vacuum(self) -> Reading[float]:
        """Give the vacuum below the surrounding pressure, Pa."""
        raise Arcor2NotImplemented("vacuum")


class PointKind(enum.StrEnum):
    """Digital or analogue."""

    DIGITAL = "digital"
    ANALOG = "analog"


class PointDirection(enum.StrEnum):
    """Seen from the controller."""

    INPUT = "input"
    OUTPUT = "output"


class OnLoss(enum.StrEnum):
    """What an output does when the device loses us."""

    HOLD = "hold"
    OFF = "off"
    ON = "on"


class IOPoint(Data, frozen=True):
    """A named point; physical value = raw value times `scale`; `debounce` in s."""

    name: str
    direction: PointDirection
    kind: PointKind
    unit: str = ""
    scale: float = 1.0
    debounce: float = 0.0
    on_loss: OnLoss | Unset = UNSET


@runtime_checkable
class HasPoints(Protocol):
    """Named inputs and outputs that other objects may use (`Generic.attach`): an IOBlock, a robot with outputs.

    All three may be called from any thread, also while the object is busy with an action.
    """

    def points(self) -> list[IOPoint]:
        """Give the points."""

    def read(self, name: str) -> Reading[bool | float]:
        """Read a point. Raises OutOfRange for an unknown name, Stale, ConnectionLost, DeviceTimeout."""

    def write(self, name: str, value: bool | float) -> None:
        """Write an output. Raises Refused for an input, NotInControl, ConnectionLost, DeviceTimeout."""


class IOBlock(Generic):
    """A block of named inputs and outputs."""

    category: ClassVar[str] = "Inputs and outputs"
    icon: ClassVar[str] = "io"

    @abc.abstractmethod
    def points(self) -> list[IOPoint]:
        """Give the points."""

    @abc.abstractmethod
    def read(self, name: str) -> Reading[bool | float]:
        """Read a point."""

    @abc.abstractmethod
    def write(self, name: str, value: bool | float) -> None:
        """Write an output; Refused for an input."""

    def pulse(self, name: str, duration: float) -> None:
        """Switch a digital output on for `duration` s."""
        raise Arcor2NotImplemented("pulse")

    def wait_for(self, name: str, value: bool, timeout: float) -> None:
        """Return when a digital point has the value; DeviceTimeout after `timeout` s."""
        raise Arcor2NotImplemented("wait_for")


class Axis(Generic):
    """A single driven axis; m or rad as its settings say."""

    category: ClassVar[str] = "Axes"
    icon: ClassVar[str] = "axis"

    @abc.abstractmethod
    def home(self) -> None:
        """Reference the axis."""

    @abc.abstractmethod
    def move_absolute(self, position: float, velocity: float) -> None:
        """Move to a position; Refused before homing."""

    @abc.abstractmethod
    def move_relative(self, distance: float, velocity: float) -> None:
        """Move by a distance."""

    @abc.abstractmethod
    def move_velocity(self, velocity: float) -> None:
        """Move with a velocity until halted."""

    @abc.abstractmethod
    def halt(self) -> None:
        """Decelerate to a stand."""

    @abc.abstractmethod
    def quick_stop(self) -> None:
        """Decelerate as quickly as set for emergencies."""

    @abc.abstractmethod
    def fault_reset(self) -> None:
        """Acknowledge a fault."""

    @abc.abstractmethod
    def position(self) -> Reading[float]:
        """Give the present position."""

    @abc.abstractmethod
    def velocity(self) -> Reading[float]:
        """Give the present velocity."""


class Code(Data, frozen=True):
    """A code that was read."""

    text: str


class NoRead(Data, frozen=True):
    """Nothing was read before the time-out."""

    reason: Literal["timeout", "unreadable"] = "timeout"


class Reader(Generic):
    """A reader of codes; a code is consumed once."""

    category: ClassVar[str] = "Identification"
    icon: ClassVar[str] = "reader"

    @abc.abstractmethod
    def trigger(self, timeout: float) -> Code | NoRead:
        """Read one code now, within `timeout` s; codes from before do not count."""


class Scale(Generic):
    """A scale."""

    category: ClassVar[str] = "Measuring"
    icon: ClassVar[str] = "scale"

    @abc.abstractmethod
    def weigh(self, stable: bool = True) -> Reading[float]:
        """Give the weight, kg; with `stable`, wait until it stands."""

    @abc.abstractmethod
    def tare(self) -> None:
        """Take the present weight as the container's."""

    @abc.abstractmethod
    def zero(self) -> None:
        """Take the present weight as nothing."""


class Printer(Generic):
    """A label printer; a label is never resent blindly."""

    category: ClassVar[str] = "Printers"
    icon: ClassVar[str] = "printer"

    @abc.abstractmethod
    def print(self, label: str) -> str:
        """Print a label; give the job's id."""

    @abc.abstractmethod
    def status(self) -> str:
        """Tell how the printer is."""

    @abc.abstractmethod
    def counter(self) -> int:
        """Give the number of labels printed."""
