"""Bench: how the suite gets at one driver and at the device, real or fake, behind it."""

import abc
import contextlib
import inspect
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, ClassVar, Final, NamedTuple

from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.objects import Generic
from arcor2_hw.testing import capabilities, quality
from arcor2_hw.testing.frames import Frames
from arcor2_hw.testing.wire import Wire


def missing(name: str) -> NotImplementedError:
    """Give the error of a hook that a bench does not have; the suite asks `Bench.has` before."""
    return NotImplementedError(f"this bench has no hook {name}")


class Check(NamedTuple):
    """A reading of the driver and what the device itself says, both in SI units; they differ by `within` at most."""

    what: str
    by_driver: float
    by_device: float
    within: float


class Bench(abc.ABC):
    """One driver on one device. A hook that is overridden is there; a case whose hooks are not all there is not run,
    which quality.yaml has to give the reason of.

    object_type: the driver's class. label: the name of the device where a cell has several of one type. guessed: it
    was made from settings alone. real: it stands in front of a real device, and is run only with `--real` and named by
    `--real-device`. connect_timeout: s given to connect. call_within: s after which a call on a silent device has
    failed. stale_after: s from the cut on after which no old value is given. lost_within, back_within: s until the
    connection tells so. stops_within: s from `stop` to standstill.
    """

    object_type: ClassVar[type[Generic]]
    label: ClassVar[str] = ""
    guessed: ClassVar[bool] = False
    real: ClassVar[bool] = False
    connect_timeout: ClassVar[float] = 2.0
    call_within: ClassVar[float] = 2.0
    stale_after: ClassVar[float] = 1.0
    lost_within: ClassVar[float] = 3.0
    back_within: ClassVar[float] = 8.0
    stops_within: ClassVar[float] = 1.0

    wire: Wire | None = None
    """What lies between driver and device, when `start` has put something there; it gives the hooks of the cable."""
    frames: Frames | None = None
    """How the driver's frames on the wire are read."""

    def __init__(self) -> None:
        self._made: list[Generic] = []

    # -------------------------------------------------------------------------------- every bench
    @property
    @abc.abstractmethod
    def address(self) -> str:
        """Give what an error has to contain to say which device is meant: a host, a port."""

    @abc.abstractmethod
    def make(self) -> Generic:
        """Give a new object for the device, not connected."""

    def start(self) -> None:  # noqa: B027
        """Start the fake, or reserve the device; once, before all cases."""

    def end(self) -> None:  # noqa: B027
        """End what `start` started."""

    def reset(self) -> None:  # noqa: B027
        """Bring the device to rest, whole and free; before each case, and harmless at any time."""

    # -------------------------------------------------------------------------------- optional hooks
    def absent(self) -> tuple[Generic, str]:
        """Give an object for a device that is not there, and its address."""
        raise missing("absent")

    def actuating(self) -> Iterable[str]:
        """Give, in words, the frames on the wire since the last case that act on the device."""
        if self.wire is None or self.frames is None:
            raise missing("actuating")
        return self.wire.acting(self.frames)

    def writes(self) -> Any:
        """Give all that was ever written, switched or moved at the device; equal when nothing was in between."""
        raise missing("writes")

    def cut(self) -> None:
        """Make the device silent, as when the cable is drawn."""
        if self.wire is None:
            raise missing("cut")
        self.wire.cut()

    def heal(self) -> None:
        """Undo `cut` and `half_frame`."""
        if self.wire is None:
            raise missing("heal")
        self.wire.heal()

    def reset_link(self) -> None:
        """Break the connection once; it can be opened anew at once."""
        if self.wire is None:
            raise missing("reset_link")
        self.wire.reset()

    def half_frame(self) -> None:
        """Let the next answer of the device break off in the middle, and nothing come after it."""
        if self.wire is None:
            raise missing("half_frame")
        self.wire.half_frame()

    def observe(self, device: Generic) -> object:
        """Take a reading of the device by the driver, one that goes stale."""
        raise missing("observe")

    def command(self, device: Generic) -> object:
        """Give a command that acts on the device and needs control."""
        raise missing("command")

    def ask(self, device: Generic) -> object:
        """Call something that speaks with the device, and therefore fails on a silent one."""
        raise missing("ask")

    def run_long(self, device: Generic) -> object:
        """Run a motion, or another act of some seconds, to its end; the device is connected and controlled."""
        raise missing("run_long")

    def running(self) -> bool:
        """Tell, from the device and past the driver, whether the act of `run_long` is under way."""
        raise missing("running")

    def foreign(self) -> AbstractContextManager[None]:
        """Have somebody else control the device."""
        raise missing("foreign")

    def orphan(self) -> list[str]:
        """Give the command line of a process that connects, takes control and does `run_long`; it will be killed."""
        raise missing("orphan")

    # -------------------------------------------------------------------------------- hooks that level silver asks for
    def readings(self, device: Generic) -> Iterable[Check]:
        """Give readings of a connected driver beside the device's own truth: units, signs and frames."""
        raise missing("readings")

    def beyond_limits(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        """Give, by what they are, calls with values that device or driver must refuse; it is controlled."""
        raise missing("beyond_limits")

    def works(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        """Give, by the name of the optional method, a call that shows that it works; the device is controlled."""
        if capabilities.to_be_shown(self.object_type):
            raise missing("works")
        return {}

    # -------------------------------------------------------------------------------- for the suite
    def has(self, hook: str) -> bool:
        """Tell whether the bench has a hook: its own, or one of the wire's."""
        if getattr(type(self), hook) is not getattr(Bench, hook):
            return True
        if hook == "works":
            return not capabilities.to_be_shown(self.object_type)
        return self.wire is not None and (hook in OF_THE_WIRE or (hook == "actuating" and self.frames is not None))

    def why_not(self, hook: str) -> str | None:
        """Give the reason in words why the bench cannot have a hook; None when it should have it."""
        return None

    @classmethod
    def type_name(cls) -> str:
        """Give the name of the object type."""
        return cls.object_type.__name__

    @classmethod
    def name(cls) -> str:
        """Give the name under which the suite runs the bench."""
        return cls.label or cls.type_name()

    @classmethod
    def quality_file(cls) -> Path:
        """Give where the driver's quality.yaml has to be: beside the module of the object type."""
        return Path(inspect.getfile(cls.object_type)).parent / quality.FILE

    def new(self) -> Generic:
        """Give an object that is disconnected after the case."""
        return self.keep(self.make())

    def keep(self, device: Generic) -> Generic:
        """Have an object disconnected after the case."""
        self._made.append(device)
        return device

    def connected(self) -> Generic:
        """Give a connected object."""
        device = self.new()
        device.connect(self.connect_timeout)
        return device

    def controlled(self) -> Generic:
        """Give an object that is connected and in control, where the type knows control."""
        device = self.connected()
        if knows_control(type(device)):
            device.take_control()
        return device

    def release(self) -> None:
        """Disconnect all objects that were given out; what a broken driver raises there is of another case."""
        while self._made:
            with contextlib.suppress(Arcor2Error):
                self._made.pop().disconnect()
        if self.wire is not None:
            self.wire.forget()


HOOKS: Final = frozenset(
    name for name, member in vars(Bench).items() if callable(member) and "missing(" in inspect.getsource(member)
)
"""The names of the optional hooks."""
OF_THE_WIRE: Final = frozenset({"cut", "heal", "reset_link", "half_frame"})
"""The hooks that a wire gives."""


def knows_control(kind: type[Generic]) -> bool:
    """Tell whether control of the type is taken by an act of its own."""
    return kind.take_control is not Generic.take_control


def needs(
    *hooks: str, for_silver: bool = False, like: str = ""
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Mark a case of the suite with the hooks that it uses.

    for_silver: a bench that lacks them need not give a reason before it claims level silver. like: another case, whose
    reason for not being run is the reason of this one too.
    """
    if unknown := set(hooks) - HOOKS:
        raise ValueError(f"a bench has no hook {', '.join(sorted(unknown))}")

    def mark(case: Callable[..., None]) -> Callable[..., None]:
        case.__dict__["needs"] = hooks
        case.__dict__["for_silver"] = for_silver
        case.__dict__["like"] = like
        return case

    return mark
