"""RealBench: the bench of a real device. Its hooks come from first_day.yaml and from the person at the device."""

import contextlib
import functools
import inspect
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, Final

import msgspec

from arcor2_hw.analysis import Library
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.cell import CellDevice
from arcor2_hw.data.object_type import ParameterMeta
from arcor2_hw.data.secret import is_secret_name
from arcor2_hw.exceptions import Arcor2Error, InvalidData, NotInControl
from arcor2_hw.objects import Axis, Generic, Gripper, IOBlock, Machine, MultiArmRobot, Robot
from arcor2_hw.objects.machine import MachineState
from arcor2_hw.objects.small import GripperState
from arcor2_hw.runtime.creation import find_type
from arcor2_hw.testing import declarations
from arcor2_hw.testing.bench import OF_A_REACTION, Bench, Check, knows_control
from arcor2_hw.testing.cell_bench import CellBench, all_settings, bench_of
from arcor2_hw.testing.first_day.declaration import FirstDay, Motion, read
from arcor2_hw.testing.first_day.person import Interrupted, Person
from arcor2_hw.testing.first_day.readings import readings_of
from arcor2_hw.testing.life import wait_until
from arcor2_hw.testing.steps import CONNECTED_STATES, stop_of

STANDSTILL: Final = frozenset(
    {
        *(MachineState.STOPPED, MachineState.IDLE, MachineState.HELD, MachineState.SUSPENDED),
        *(MachineState.COMPLETE, MachineState.ABORTED),
    }
)
"""States of a machine in which nothing moves."""
FREE_WITHIN: Final = 10.0
"""Time limit for a device to end the control of a lost owner, s."""
LAG: Final = 0.15
"""Maximum age of the state over a second connection, s: a moving device is observed over two connections."""
PULLED_WITHIN: Final = 120.0
"""Time limit for the person to pull the cable, s."""
ORPHANS: Final = 2
"""Number of processes that one case starts and kills."""
STOP_TIMEOUT: Final = 5.0
"""Time limit of the stop after Ctrl-C, s."""
AT_STANDSTILL: Final = 1e-3
"""Velocity of an axis that counts as standstill, m/s or rad/s."""


class RealBench(CellBench):
    """A real device. No call acts on it after `interrupt`."""

    case_within: ClassVar[float] = 900.0  # the person is asked during some cases
    day: ClassVar[FirstDay]
    file: ClassVar[Path]
    guessed: ClassVar[bool] = True
    person: Person

    def __init__(self) -> None:
        super().__init__()
        self.by_hand = False
        self.asked: dict[str, dict[str, Any]] = {}
        self._interrupted = threading.Event()
        self._pulled = False
        self.starts: dict[str, float] = {}
        self._observer: Generic | None = None

    # -------------------------------------------------------------------------------- life
    def make(self) -> Generic:
        """Return a new object, unless the session was ended."""
        self._go_on()
        return super().make()

    def end(self) -> None:
        """Disconnect the observer and remove the wire."""
        if self._observer is not None:
            with contextlib.suppress(Arcor2Error):
                self._observer.disconnect()
            self._observer = None
        super().end()

    def controlled(self) -> Generic:
        """Return an object in control. A device that lost its owner in the previous case may need some seconds."""
        device = self.connected()
        until = time.monotonic() + FREE_WITHIN
        while knows_control(type(device)):
            try:
                device.take_control()
                break
            except NotInControl:
                if time.monotonic() > until:
                    raise
                time.sleep(LAG)
        return device

    def reset(self) -> None:
        """Repair the connection."""
        self.heal()

    def _go_on(self) -> None:
        if self._interrupted.is_set():
            raise Interrupted("The session was ended.")

    def interrupt(self) -> None:
        """Refuse every further call, heal the wire, and stop all objects of this bench, within some seconds."""
        self._interrupted.set()
        if self.wire is not None:
            self.wire.heal()
        self.stop_all()

    def stop_all(self) -> None:
        """Stop the objects that may have started something, each within STOP_TIMEOUT s."""
        threads = [threading.Thread(target=_stop, args=(each,), daemon=True) for each in self._made]
        for thread in threads:
            thread.start()
        until = time.monotonic() + STOP_TIMEOUT
        for thread in threads:
            thread.join(max(0.0, until - time.monotonic()))

    @property
    def real_address(self) -> str:
        """Return the address of the device itself, also while a wire is in front of it."""
        place = self.place
        if place is None:
            return self.entry.name
        return place.path or (f"{place.host}:{place.ports[0]}" if place.ports else place.host)

    @functools.cached_property
    def described_settings(self) -> Mapping[str, ParameterMeta]:
        """Return the metadata of the settings by name, read from the source of the type."""
        found = Library([declarations.source_of(self.object_type)]).analyse(self.object_type.__name__)
        return {each.name: each for each in found.meta.settings}

    @property
    def reading(self) -> str:
        """Return the method that reads, if there is one without arguments."""
        return self._read

    def secrets(self) -> list[str]:
        """Return the values of secret settings, and the content of files that contain a secret."""
        found = []
        for name, value in all_settings(self.entry, self.object_type).items():
            if not (isinstance(value, str) and value):
                continue
            if self.described_settings[name].secret is True:
                found.append(value)
            elif name.endswith("_file") and is_secret_name(name.removesuffix("_file")):
                with contextlib.suppress(OSError, UnicodeDecodeError):
                    found.append(Path(value).read_text().strip())
        return found

    # -------------------------------------------------------------------------------- motions
    def command(self, device: Generic) -> object:
        """Execute the small motion."""
        return self._execute(self.day.small, "small", device)

    def run_long(self, device: Generic) -> object:
        """Execute the full motion."""
        return self._execute(self.day.full, "full", device)

    def ask(self, device: Generic) -> object:
        """Call a method that communicates with the device."""
        self._go_on()
        if isinstance(self.day.ask, Unset):
            return super().ask(device)
        return self.command(device) if self.day.ask == "small" else self._call(device, self.day.ask)

    def _execute(self, motion: Motion | Unset, which: str, device: Generic) -> object:
        self._go_on()
        assert not isinstance(motion, Unset)
        if isinstance(motion.joint, Unset):
            call: Callable[..., object] = getattr(device, str(motion.call))
            return call(**motion.arguments, **self.asked.get(which, {}))
        assert isinstance(device, Robot)
        joints = device.robot_joints()
        joint = joints[motion.joint - 1]
        start = self.starts.setdefault(which, joint.value)
        if abs(joint.value - start) > 1.5 * abs(motion.by):  # the other motion has moved the joint
            start = self.starts[which] = joint.value
        joint.value = start if abs(joint.value - start) > abs(motion.by) / 2 else start + motion.by
        device.move_to_joints(joints, motion.speed)
        return None

    def moves(self, which: str) -> str:
        """Return what a declared motion does, as a sentence."""
        motion = {"small": self.day.small, "full": self.day.full}.get(which, UNSET)
        if isinstance(motion, Unset):
            return f"It executes what `{which}` of {self.entry.bench} does."
        values = ", ".join(f"{name} = {value}" for name, value in self.asked.get(which, {}).items())
        return motion.sentence + (f" ({values})" if values else "")

    def running(self) -> bool:
        """Return whether the device moves, read over a separate connection; without one, ask the person."""
        self._go_on()
        device = self._watcher()
        if device is None:
            return not self.person.confirm("Does the device stand still?")
        if not self._moving(device):
            return False
        time.sleep(LAG)
        return self._moving(device)

    def _moving(self, device: Generic) -> bool:
        match device:
            case Robot():
                return device.state().moving
            case Gripper():
                return device.state() is GripperState.MOVING
            case Axis():
                return abs(device.velocity().value) > AT_STANDSTILL
            case Machine():
                return device.machine_state() not in STANDSTILL
            case IOBlock():
                return bool(device.read(self.asked["full"]["name"]).value)
        raise AssertionError(f"the standstill of a {type(device).__name__} cannot be read")

    def _watcher(self) -> Generic | None:
        """Return the object that observes the device, or None if none is connected."""
        if not self._single:
            if self._observer is None:
                self._observer = self._made_with({})
                self._observer.connect(self.connect_timeout)
            if self._observer.connection not in CONNECTED_STATES and not self._pulled:
                observer = self._observer
                wait_until(lambda: observer.connection in CONNECTED_STATES, self.back_within, "observing the device")
            return self._observer if self._observer.connection in CONNECTED_STATES else None
        return next((each for each in self._made if each.connection in CONNECTED_STATES), None)

    @property
    def _single(self) -> bool:
        return self.day.single_client or (self.place is not None and bool(self.place.path))

    def orphan(self) -> list[str]:
        """Return the command line of a process that executes the full motion, in the range of the earlier ones."""
        motion, device = self.day.full, self._watcher()
        if "full" not in self.starts and isinstance(device, Robot) and not isinstance(motion, Unset):
            self.starts["full"] = device.robot_joints()[int(motion.joint or 1) - 1].value
        state = msgspec.json.encode([self.asked, self.starts]).decode()
        command = [sys.executable, "-P", "-m", "arcor2_hw.testing.first_day.orphan"]
        return [*command, str(self.file), self.entry.name, state]

    def start_orphan(self) -> "subprocess.Popen[bytes]":
        """Start the process, at most ORPHANS times in one case."""
        self._go_on()
        assert len(self._orphans) < ORPHANS, f"the process that executes the motion ended {ORPHANS} times"
        return super().start_orphan()

    # -------------------------------------------------------------------------------- the person
    def cut(self) -> None:
        """Interrupt the connection by the wire, or ask the person to pull the cable."""
        if not self.by_hand:
            super().cut()
            return
        self._pulled = True
        connected = [each for each in self._made if each.connection in CONNECTED_STATES]
        if not connected:
            self.person.done("Pull the cable of the device, then press Enter.")
            return
        self.person.say("Pull the cable of the device now.", "warning")
        wait_until(
            lambda: not any(each.connection in CONNECTED_STATES for each in connected),
            PULLED_WITHIN,
            "pulling the cable",
        )

    def heal(self) -> None:
        """Undo `cut`."""
        if self._pulled:
            self.person.done("Plug the cable in again, then press Enter.")
            self._pulled = False
        if self.wire is not None:
            self.wire.heal()

    @contextlib.contextmanager
    def foreign(self) -> Iterator[None]:
        """Ask the person to give control to another client."""
        assert not isinstance(self.day.elsewhere, Unset)
        self.person.done(f"{self.day.elsewhere.take} Then press Enter.")
        try:
            yield
        finally:
            if not self._interrupted.is_set():
                self.person.done(f"{self.day.elsewhere.give_back} Then press Enter.")

    def readings(self, device: Generic) -> Iterable[Check]:
        """Have the person compare the readings with the display of the device."""
        values = readings_of(device, self._read)
        self.person.show(["reading", "by the driver"], [[name, text] for name, text, _ in values])
        agrees = self.person.confirm(f"Does the device show the same values ({self.day.display})?")
        return [
            Check(name, value, value if agrees else "the person reports another value") for name, _, value in values
        ]

    def beyond_limits(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        """Return calls that move nothing even if they are not refused: moves to the present joints."""
        assert isinstance(device, Robot)
        joints = device.robot_joints()
        return {
            "a speed above 1": lambda: device.move_to_joints(joints, 1.5),
            "a speed of nothing": lambda: device.move_to_joints(joints, 0.0),
        }

    # -------------------------------------------------------------------------------- available hooks
    def has(self, hook: str) -> bool:
        """Return whether the bench has a hook."""
        return self.why_not(hook) is None and Bench.has(self, hook)

    def why_not(self, hook: str) -> str | None:
        """Return why the bench has no such hook."""
        if getattr(type(self), hook) not in (getattr(RealBench, hook), getattr(CellBench, hook)):
            return None  # a custom bench
        day = self.day
        if hook in OF_A_REACTION and self.object_type.loss_reaction.kind is not OF_A_REACTION[hook]:
            return None
        if hook in ("cut", "heal") and self.by_hand:
            return None
        if hook == "command" and isinstance(day.small, Unset):
            return "first_day.yaml declares no small motion"
        if hook in ("run_long", "running", "orphan") and isinstance(day.full, Unset):
            return "first_day.yaml declares no full motion"
        if hook == "running" and not _observable(self.object_type):
            return "its standstill cannot be read"
        if hook == "orphan" and self._single:
            return "it accepts one connection only, so it cannot be observed while another process uses it"
        if hook == "foreign" and isinstance(day.elsewhere, Unset):
            return "first_day.yaml does not state how to give control to another client"
        if hook == "readings" and (isinstance(day.display, Unset) or not self._read):
            return "first_day.yaml does not say where the device shows its readings"
        single_arm = issubclass(self.object_type, Robot) and not issubclass(self.object_type, MultiArmRobot)
        if hook == "beyond_limits" and not single_arm:
            return "no command is known that is refused and would do nothing otherwise"
        return self._lack(hook) if hook not in _OURS else None


_OURS: Final = frozenset({"command", "run_long", "running", "orphan", "foreign", "readings", "beyond_limits"})


def _stop(device: Generic) -> None:
    with contextlib.suppress(Arcor2Error, AssertionError):
        if device.connection in CONNECTED_STATES and (
            not knows_control(type(device)) or device.control_owner() == "us"
        ):
            stop_of(device)()


def _observable(kind: type[Generic]) -> bool:
    return issubclass(kind, Robot | Machine | Gripper | Axis | IOBlock)


def real_bench(entry: CellDevice, file: Path) -> type[RealBench]:
    """Create the bench of a real device.

    Args:
        entry: The device in the cell.yaml.
        file: Path of the cell.yaml.

    Raises:
        Arcor2Error: It cannot be created; the message names the device.
    """
    kind = find_type(entry.type)
    day = read(Path(inspect.getfile(kind)).parent).get(entry.type, FirstDay())
    if isinstance(entry.wire, Unset) and not isinstance(day.wire, Unset):
        entry = msgspec.structs.replace(entry, wire=day.wire)
    base = bench_of(entry)
    if not issubclass(base, CellBench):
        raise InvalidData(
            "{name}: the bench {bench} does not derive from CellBench", name=entry.name, bench=entry.bench
        )
    return type(base.__name__, (base, RealBench), {"day": day, "file": file, "guessed": True})


# Names before version 0.2.
STOP_WITHIN = STOP_TIMEOUT
