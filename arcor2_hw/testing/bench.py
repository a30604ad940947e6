"""Bench: the suite's access to one driver and to its device, real or simulated."""

import abc
import contextlib
import inspect
import subprocess
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, ClassVar, Final, NamedTuple

from arcor2_hw.data.device import LossKind
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.objects import Generic
from arcor2_hw.testing import capabilities, quality
from arcor2_hw.testing.frames import Frames
from arcor2_hw.testing.life import POLL
from arcor2_hw.testing.outcomes import Kind
from arcor2_hw.testing.own_time import own_time
from arcor2_hw.testing.time_limit import CallHangs
from arcor2_hw.testing.wire import Wire


def missing(name: str) -> NotImplementedError:
    """Return the error of a hook that a bench does not have. The suite calls `Bench.has` first."""
    return NotImplementedError(f"this bench has no hook {name}")


class Check(NamedTuple):
    """A value that the driver returned, the value of the device itself, and their maximum difference, in SI units.

    Values are numbers, sequences of numbers, or objects that are compared for equality.
    """

    what: str
    by_driver: Any
    by_device: Any
    within: float = 0.0

    @property
    def agrees(self) -> bool:
        """Return whether the values agree."""
        return _agree(self.by_driver, self.by_device, self.within)

    def __str__(self) -> str:
        apart = f" (allowed difference: {self.within:g})" if self.within else ""
        return f"{self.what}: the driver returned {self.by_driver!r}, the device has {self.by_device!r}{apart}"


def _agree(one: Any, other: Any, within: float) -> bool:
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(_agree(a, b, within) for a, b in zip(one, other, strict=True))
    if isinstance(one, int | float) and isinstance(other, int | float):
        return abs(one - other) <= within
    return bool(one == other)


class Bench(abc.ABC):
    """One driver on one device.

    A hook is available when it is overridden. A case whose hooks are not all available is skipped; quality.yaml has to
    state the reason.

    Attributes:
        object_type: The driver's class.
        label: Name of the device where a cell has several of one type.
        guessed: Whether it was created from settings alone.
        independent: Whether driver and fake were written independently; if not, the level is bronze at most.
        real: Whether it uses a real device; it runs only with `--real` and the device named by `--real-device`.
        case_within: Time in which each case ends, s; a call that has not returned by then fails the case.
        connect_timeout: Time limit passed to connect, s.
        call_within: Time in which a call on a silent device fails, s.
        stale_after: Time from the cut after which no old value is returned, s.
        fresh_within: Time after a change of the device in which a reading that the driver polls follows, s.
        lost_within: Time until the connection is reported as lost, s.
        back_within: Time until the connection is reported as online again, s.
        stops_within: Time from `stop` to standstill, s.
        loss_watched: Time for which a device that holds or continues is observed after its driver has died, s: longer
            than any watchdog of the device.
        progress_within: Longest time between two changes of `progress` during the action, s.
    """

    object_type: ClassVar[type[Generic]]
    label: ClassVar[str] = ""
    guessed: ClassVar[bool] = False
    independent: ClassVar[bool] = True
    real: ClassVar[bool] = False
    case_within: ClassVar[float] = 60.0
    connect_timeout: ClassVar[float] = 2.0
    call_within: ClassVar[float] = 2.0
    stale_after: ClassVar[float] = 1.0
    fresh_within: ClassVar[float] = 1.0
    lost_within: ClassVar[float] = 3.0
    back_within: ClassVar[float] = 8.0
    stops_within: ClassVar[float] = 1.0
    loss_watched: ClassVar[float] = 3.0
    progress_within: ClassVar[float] = 1.0

    wire: Wire | None = None
    """The wire between driver and device, if `start` created one; it provides the hooks of the cable."""
    frames: Frames | None = None
    """Reader of the driver's frames on the wire."""
    hanging: CallHangs | None = None
    """The call that did not return. While it runs, no other case runs."""

    def __init__(self) -> None:
        self._made: list[Generic] = []
        self._orphans: list[subprocess.Popen[bytes]] = []

    # -------------------------------------------------------------------------------- every bench
    @property
    @abc.abstractmethod
    def address(self) -> str:
        """Return the text by which an error has to identify the device: a host or a port."""

    @abc.abstractmethod
    def make(self) -> Generic:
        """Return a new object for the device, not connected."""

    def start(self) -> None:  # noqa: B027
        """Start the fake or reserve the device. Called once before all cases."""

    def end(self) -> None:  # noqa: B027
        """End what `start` started."""

    def reset(self) -> None:  # noqa: B027
        """Stop the device, clear its faults and release control. Called before each case."""

    # -------------------------------------------------------------------------------- optional hooks
    def absent(self) -> tuple[Generic, str]:
        """Return an object for a missing device, and its address."""
        raise missing("absent")

    def actuating(self) -> Iterable[str]:
        """Return descriptions of the frames since the last case that act on the device."""
        if self.wire is None or self.frames is None:
            raise missing("actuating")
        return self.wire.acting(self.frames)

    def writes(self) -> Any:
        """Return a value that changes with everything that is written, switched or moved at the device."""
        raise missing("writes")

    def cut(self) -> None:
        """Make the device silent, as when the cable is unplugged."""
        if self.wire is None:
            raise missing("cut")
        self.wire.cut()

    def heal(self) -> None:
        """Undo `cut` and `half_frame`."""
        if self.wire is None:
            raise missing("heal")
        self.wire.heal()

    def reset_link(self) -> None:
        """Break the connection once. It can be opened again at once."""
        if self.wire is None:
            raise missing("reset_link")
        self.wire.reset()

    def half_frame(self) -> None:
        """Cut off the next answer of the device in the middle."""
        if self.wire is None:
            raise missing("half_frame")
        self.wire.half_frame()

    def observe(self, device: Generic) -> object:
        """Take a reading with the driver that can become stale."""
        raise missing("observe")

    def command(self, device: Generic) -> object:
        """Execute a command that acts on the device and requires control."""
        raise missing("command")

    def ask(self, device: Generic) -> object:
        """Call a method that communicates with the device, so that it fails if the device is silent."""
        raise missing("ask")

    def run_long(self, device: Generic) -> object:
        """Run a motion or another action of some seconds to its end. The device is connected and controlled."""
        raise missing("run_long")

    def running(self) -> bool:
        """Return whether the action of `run_long` is running, read from the device without the driver."""
        raise missing("running")

    def foreign(self) -> AbstractContextManager[None]:
        """Have another client control the device."""
        raise missing("foreign")

    def orphan(self) -> list[str]:
        """Return the command line of a process that connects, takes control and acts until it is killed.

        It runs an action like that of `run_long`. If the type declares that it holds, the process makes the device hold
        something.
        """
        raise missing("orphan")

    def holding(self) -> object:
        """Return the held state of the device, such as grip or outputs, read without the driver.

        Falsy if it holds nothing.
        """
        raise missing("holding")

    def progress(self) -> float:
        """Return the completed fraction of the action of `orphan`, 0 to 1, read from the device without the driver."""
        raise missing("progress")

    # -------------------------------------------------------------------------------- hooks for level silver
    def readings(self, device: Generic) -> Iterable[Check]:
        """Return readings of a connected driver with the values of the device, to check units, signs and frames."""
        raise missing("readings")

    def results(self, device: Generic) -> Iterable[Check]:
        """Call each action that returns a value at least twice, and change the device in between.

        Yield the result of each call, by the name of the action, with the value of the device. The device is
        controlled. For a type without such an action, use a reading.
        """
        raise missing("results")

    def beyond_limits(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        """Return calls with values that device or driver must refuse, by description. The device is controlled."""
        raise missing("beyond_limits")

    def works(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        """Return for each optional method a call that shows that it works. The device is controlled."""
        if capabilities.to_be_shown(self.object_type):
            raise missing("works")
        return {}

    # -------------------------------------------------------------------------------- for the suite
    def has(self, hook: str) -> bool:
        """Return whether the bench has a hook: its own, or one of the wire."""
        if getattr(type(self), hook) is not getattr(Bench, hook):
            return True
        if hook == "works":
            return not capabilities.to_be_shown(self.object_type)
        if hook in OF_A_REACTION:
            return self.object_type.loss_reaction.kind is not OF_A_REACTION[hook]
        return self.wire is not None and (hook in OF_THE_WIRE or (hook == "actuating" and self.frames is not None))

    def why_not(self, hook: str) -> str | None:
        """Return why the bench cannot have a hook, or None if it should have it."""
        return None

    @classmethod
    def type_name(cls) -> str:
        """Return the name of the object type."""
        return cls.object_type.__name__

    @classmethod
    def name(cls) -> str:
        """Return the name of the bench in the suite."""
        return cls.label or cls.type_name()

    @classmethod
    def quality_file(cls) -> Path:
        """Return the path of the driver's quality.yaml: next to the module of the object type."""
        return Path(inspect.getfile(cls.object_type)).parent / quality.FILE

    def new(self) -> Generic:
        """Return an object that is disconnected after the case."""
        return self.keep(self.make())

    def keep(self, device: Generic) -> Generic:
        """Disconnect an object after the case."""
        self._made.append(device)
        return device

    def connected(self) -> Generic:
        """Return a connected object."""
        device = self.new()
        device.connect(self.connect_timeout)
        return device

    def controlled(self) -> Generic:
        """Return an object that is connected and, where the type has control, in control."""
        device = self.connected()
        if knows_control(type(device)):
            device.take_control()
        return device

    def polled(self, what: str, read: Callable[[], object], real: object, within: float = 0.0) -> Check:
        """Return the check of a polled reading as soon as it agrees, or after `fresh_within` s."""
        began = own_time()
        while not (check := Check(what, read(), real, within)).agrees and not began.is_past(self.fresh_within):
            time.sleep(POLL)
        return check

    def start_orphan(self) -> subprocess.Popen[bytes]:
        """Start the process of `orphan`. `release` kills it, if it still runs."""
        process = subprocess.Popen(self.orphan())  # noqa: S603 - the command line of the bench
        self._orphans.append(process)
        return process

    def release(self) -> None:
        """Disconnect all objects. Errors of a broken driver are ignored here, because another case checks them."""
        while self._orphans:
            process = self._orphans.pop()
            process.kill()
            process.wait()
        while self._made:
            with contextlib.suppress(Arcor2Error):
                self._made.pop().disconnect()
        if self.wire is not None:
            self.wire.forget()


HOOKS: Final = frozenset(
    name for name, member in vars(Bench).items() if callable(member) and "missing(" in inspect.getsource(member)
)
"""Names of the optional hooks."""
OF_THE_WIRE: Final = frozenset({"cut", "heal", "reset_link", "half_frame"})
"""Hooks that a wire provides."""
OF_A_REACTION: Final = {"holding": LossKind.HOLDS, "progress": LossKind.CONTINUES}
"""Hooks that are needed only for one declared reaction to a connection loss."""


def knows_control(kind: type[Generic]) -> bool:
    """Return whether the type has a separate call to take control."""
    return kind.take_control is not Generic.take_control


def needs(
    *hooks: str, for_silver: bool = False, like: str = ""
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Mark a case of the suite with the hooks that it uses.

    Args:
        hooks: The hooks.
        for_silver: Whether a bench without them must give a reason only for level silver.
        like: Another case whose reason for being skipped also applies to this one.
    """
    if unknown := set(hooks) - HOOKS:
        raise ValueError(f"a bench has no hook {', '.join(sorted(unknown))}")

    def mark(case: Callable[..., None]) -> Callable[..., None]:
        case.__dict__["needs"] = hooks
        case.__dict__["for_silver"] = for_silver
        case.__dict__["like"] = like
        return case

    return mark


def obstacle(bench: Bench, case: Callable[..., None], name: str) -> tuple[Kind, str] | None:
    """Return why a case is not run on a bench, or None: its hooks are missing, or quality.yaml excludes it.

    FAILED: a hook is missing without a reason, or a reason is given although the bench can run the case.
    """
    lacking = [hook for hook in getattr(case, "needs", ()) if not bench.has(hook)]
    reason = None
    try:
        claims = quality.read(bench.quality_file())
        reason = claims.reason(bench.type_name(), name)
        if reason is None and lacking and (like := getattr(case, "like", "")):
            reason = claims.reason(bench.type_name(), like)
    except Arcor2Error as error:
        if not bench.guessed:  # otherwise the case `described` reports the fault
            return Kind.FAILED, str(error)
    if reason is not None and (lacking or bench.guessed):
        return Kind.NOT_RUN, reason
    if reason is not None:
        return Kind.FAILED, f"quality.yaml excludes {name}, but the bench can run it"
    if not lacking:
        return None
    if all(bench.why_not(hook) for hook in lacking):
        return Kind.LACKING, "; ".join(dict.fromkeys(str(bench.why_not(hook)) for hook in lacking))
    if getattr(case, "for_silver", False):
        return Kind.LACKING, f"the bench has no hook {', '.join(lacking)}"
    return Kind.FAILED, (
        f"the bench of {bench.type_name()} lacks {', '.join(lacking)}: implement it, or give the reason "
        f"in quality.yaml under not_run, as {name}"
    )
