"""Asks the controller again and again, in a thread of its own; everybody else reads what was told. Never writes."""

import threading
import time
from collections.abc import Callable
from typing import Final, NamedTuple

from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout, NotConnected, Refused, Stale
from arcor2_hw.objects.observing import Observing

from .frames import Configuration, RobTarget, pose_from, to_radians
from .rws import FIRST_WITHIN, Fields, Rws
from .settings import ARMS, YumiSettings

TASKS: Final = {"left": "T_ROB_L", "right": "T_ROB_R"}
UNITS: Final = {"left": "ROB_L", "right": "ROB_R"}
PROGRAMS: Final = {"left": "Arcor2Left", "right": "Arcor2Right"}
"""Names of the programs as they are loaded from the .pgf files."""
FRESH: Final = 0.8
"""Seconds: how old a position may be. A look takes six requests, each of which may take ten ms and more."""
AT_REST: Final = 2e-3
"""rad/s below which a joint counts as standing."""


class _Leaving(Exception):
    """Observing ends in the middle of a look."""


class Holder(NamedTuple):
    """Who has mastership of RAPID."""

    alias: str
    application: str
    location: str

    def __str__(self) -> str:
        beside = ", ".join(part for part in (self.application, self.location) if part)
        return (self.alias or "somebody") + (f" ({beside})" if beside else "")


class Panel(NamedTuple):
    """What a person changes, and since when (monotonic) it is known."""

    monotonic: float
    operation_mode: str
    speed_ratio: float
    collision: str
    programs: dict[str, str]
    holder: Holder | None
    lead_through: dict[str, bool | None]
    """None where the controller has no such resource."""

    @property
    def ours(self) -> bool:
        """Tell whether the programs of both tasks are our motion servers."""
        return self.programs == PROGRAMS


class Sample(NamedTuple):
    """One look: when it was begun (monotonic), joints (rad, axes 1 to 7), flange in the robot's frame, and so on."""

    monotonic: float
    control_state: str
    running: bool
    joints: dict[str, list[float]]
    targets: dict[str, RobTarget]
    speeds: dict[str, float]

    @property
    def age(self) -> float:
        """Give the seconds since it was begun."""
        return time.monotonic() - self.monotonic

    @property
    def moving(self) -> bool:
        """Tell whether an arm moves."""
        return max(self.speeds.values()) > AT_REST


def read_panel(rws: Rws) -> Panel:
    """Ask for what a person changes."""
    panel = Panel(0.0, "", 0.0, "", {}, None, {})
    for part in PARTS:
        panel = part(rws, panel)
    return panel._replace(monotonic=time.monotonic())


def _mode(rws: Rws, panel: Panel) -> Panel:
    return panel._replace(operation_mode=rws.value("/rw/panel/opmode", "opmode"))


def _speed(rws: Rws, panel: Panel) -> Panel:
    ratio = rws.value("/rw/panel/speedratio", "speedratio")
    try:
        return panel._replace(speed_ratio=float(ratio) / 100.0)
    except ValueError:
        raise ConnectionLost(f"{rws.who} gave a speed ratio that is none", ratio) from None


def _collision(rws: Rws, panel: Panel) -> Panel:
    return panel._replace(collision=rws.value("/rw/panel/coldetstate", "coldetstate"))


def _programs(rws: Rws, panel: Panel) -> Panel:
    return panel._replace(programs={arm: _program(rws, task) for arm, task in TASKS.items()})


def _holder(rws: Rws, panel: Panel) -> Panel:
    return panel._replace(holder=holder(rws))


def _lead_throughs(rws: Rws, panel: Panel) -> Panel:
    return panel._replace(lead_through={arm: _lead_through(rws, unit) for arm, unit in UNITS.items()})


PARTS: Final = (_mode, _speed, _collision, _programs, _holder, _lead_throughs)
"""What the panel is asked for in, one part beside each look: a burst of all would let the positions grow old."""


def holder(rws: Rws) -> Holder | None:
    """Ask who has mastership of RAPID; None when nobody has."""
    told = rws.get("/rw/mastership/rapid")
    if not told or told[0].get("mastership", "nomaster") == "nomaster":
        return None
    return Holder(told[0].get("alias", ""), told[0].get("application", ""), told[0].get("location", ""))


def _program(rws: Rws, task: str) -> str:
    try:
        return rws.value(f"/rw/rapid/tasks/{task}/program", "name")
    except Refused:  # no program is loaded
        return ""


def lead_through_path(unit: str) -> str:
    """Give the resource of lead-through of a mechanical unit."""
    return f"/rw/motionsystem/mechunits/{unit}/lead-through"


def _lead_through(rws: Rws, unit: str) -> bool | None:
    try:
        return rws.value(lead_through_path(unit), "status").lower() == "active"
    except Refused:
        return None


def read_running(rws: Rws) -> bool:
    """Ask whether RAPID runs."""
    return rws.value("/rw/rapid/execution", "ctrlexecstate") == "running"


def read_joints(fields: Fields) -> list[float]:
    """Give the joints of a jointtarget, rad; axis 7 is eax_a."""
    names = [*(f"rax_{number}" for number in range(1, 7)), "eax_a"]
    return to_radians(float(fields[name]) for name in names)


def read_target(fields: Fields) -> RobTarget:
    """Give a robtarget; its eax_a is the arm angle."""
    pose = pose_from(
        [float(fields[name]) for name in ("x", "y", "z")], [float(fields[f"q{number}"]) for number in range(1, 5)]
    )
    configuration = Configuration(*(int(float(fields[name])) for name in ("cf1", "cf4", "cf6", "cfx")))
    return RobTarget(pose, configuration, to_radians([float(fields["eax_a"])])[0])


class Observer:
    """The observed controller. `seen` is called on the observing thread with each sample."""

    def __init__(
        self,
        name: str,
        settings: YumiSettings,
        seen: Callable[[Sample], None] = lambda _: None,
        lost: Callable[[DeviceError], None] = lambda _: None,
    ) -> None:
        self.rws = Rws(name, settings.host, settings.rws_port, settings.user, settings.password)
        self.who = self.rws.who
        self.fresh = max(FRESH, 3.0 * settings.poll_period)
        self.version = ""
        self._period = settings.poll_period
        self._seen = seen
        self._sample: Sample | None = None
        self._panel: Panel | None = None
        self._news = threading.Condition()
        self._hurry = threading.Event()
        self._ending = False
        self._part = 0
        self.observing = Observing(self.who, self._open, self._watch, self._close, lost)

    def connect(self, timeout: float) -> None:
        """Begin to observe. Raises NotConnected, DeviceTimeout, ConnectionLost, each naming host and port."""
        self._ending = False
        self.observing.start(timeout)

    def leave(self) -> None:
        """Ask no more; the request under way is the last. To be followed by `disconnect`."""
        self._ending = True
        self._hurry.set()

    def disconnect(self) -> None:
        """Stop observing and end the session; harmless when it was not observed."""
        online = self.observing.online
        self.leave()
        self.observing.stop()
        if online:
            self.rws.logout()

    def newest(self) -> Sample | None:
        """Give the newest sample, however old."""
        return self._sample

    def sample(self) -> Sample:
        """Give the newest sample. Raises NotConnected, ConnectionLost, or Stale when it is too old."""
        newest = self._sample
        if newest is not None and newest.age <= self.fresh and self.observing.online:
            return newest
        self.observing.check()
        if newest is None:
            raise NotConnected(f"{self.who} has told nothing yet")
        raise Stale(f"what {self.who} told last is {newest.age:.2f} s old, {self.fresh:g} s are allowed")

    def panel(self) -> Panel:
        """Give what a person changes, as known last. Raises as `sample`."""
        self.sample()
        assert self._panel is not None
        return self._panel

    @property
    def known_panel(self) -> Panel | None:
        """Give what a person changes, as known last, however old."""
        return self._panel

    def note(self, panel: Panel) -> None:
        """Take what was asked elsewhere."""
        self._panel = panel

    def sample_after(self, moment: float, within: float = 1.0) -> Sample:
        """Wait for a sample that was begun after a moment (monotonic). Raises DeviceTimeout, or how it was lost."""
        self._hurry.set()
        with self._news:
            while (newest := self._sample) is None or newest.monotonic < moment:
                self.observing.check()
                left = moment + within - time.monotonic()
                if left <= 0.0 or not self._news.wait(min(left, 0.2)):
                    self.observing.check()
                    if time.monotonic() > moment + within:
                        raise DeviceTimeout(f"{self.who} has told nothing new for {within:g} s")
        return newest

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        with self.rws.all_until(time.monotonic() + timeout):
            self.version = self.rws.get("/rw/system", FIRST_WITHIN)[0].get("rwversion", "")
            if not self.version.startswith("6."):
                version = self.version or "?"
                raise Refused(f"{self.who} has RobotWare {version}; this driver speaks RWS 1.0 of RobotWare 6")
            self._sample = None
            self._panel = read_panel(self.rws)
            self._look()

    def _close(self) -> None:
        self.rws.close()

    def _watch(self, stopping: threading.Event) -> None:
        while not stopping.is_set():
            self._hurry.wait(self._period)
            self._hurry.clear()
            try:
                self._look()
            except _Leaving:
                stopping.wait(1.0)
                return
            self._part = (self._part + 1) % len(PARTS)
            assert self._panel is not None
            noted = self._panel
            found = PARTS[self._part](self.rws, noted)
            if self._panel is noted:  # else it was asked elsewhere in between
                self._panel = found._replace(monotonic=time.monotonic())

    def _go_on(self) -> None:
        if self._ending:
            raise _Leaving

    def _look(self) -> None:
        began, rws = time.monotonic(), self.rws
        self._go_on()
        state = rws.value("/rw/panel/ctrlstate", "ctrlstate")
        self._go_on()
        running = read_running(rws)
        joints, targets = {}, {}
        for arm, unit in UNITS.items():
            place = f"/rw/motionsystem/mechunits/{unit}"
            self._go_on()
            told = rws.get(f"{place}/jointtarget")
            self._go_on()
            posed = rws.get(f"{place}/robtarget", tool="tool0", wobj="wobj0", coordinate="World")
            try:
                joints[arm], targets[arm] = read_joints(told[0]), read_target(posed[0])
            except (IndexError, KeyError, ValueError):
                raise ConnectionLost(f"{self.who} gave a position of {unit} that is none", f"{told} {posed}") from None
        sample = Sample(began, state, running, joints, targets, self._speeds(began, joints))
        with self._news:
            self._sample = sample
            self._news.notify_all()
        self._seen(sample)

    def _speeds(self, now: float, joints: dict[str, list[float]]) -> dict[str, float]:
        last = self._sample
        if last is None:
            return dict.fromkeys(ARMS, 0.0)
        spent = max(now - last.monotonic, 1e-3)
        return {
            arm: max(abs(b - a) for a, b in zip(last.joints[arm], joints[arm], strict=True)) / spent for arm in ARMS
        }


def world(object_pose: Pose, target: RobTarget, tcp: Pose) -> Pose:
    """Give the TCP in the scene's world, for a flange in the robot's frame."""
    return object_pose * target.pose * tcp
