"""Observation of the controller: one thread polls Robot Web Services. It never writes."""

import itertools
import time
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from arcor2_hw.exceptions import ConnectionLost, NotConnected, Refused
from arcor2_hw.objects.state_observer import Snapshot, StateObserver

from .frames import Configuration, RobTarget, pose_from, to_radians
from .rws import FIRST_ANSWER_TIMEOUT, Fields, Rws
from .settings import ARMS, YumiSettings

TASKS: Final = {"left": "T_ROB_L", "right": "T_ROB_R"}
UNITS: Final = {"left": "ROB_L", "right": "ROB_R"}
PROGRAMS: Final = {"left": "Arcor2Left", "right": "Arcor2Right"}
"""Names of the programs that the .pgf files load."""
MAX_SAMPLE_AGE: Final = 0.8
"""Maximum age of a sample, s: it takes six requests of ten ms or more each."""
STANDSTILL_SPEED: Final = 2e-3
"""Joint speed below which a joint is at standstill, rad/s."""


class Holder(NamedTuple):
    """Client that has mastership of RAPID."""

    alias: str
    application: str
    location: str

    def __str__(self) -> str:
        details = ", ".join(part for part in (self.application, self.location) if part)
        return (self.alias or "another client") + (f" ({details})" if details else "")


class Panel(NamedTuple):
    """State that a person changes, and the time when it was read (monotonic)."""

    monotonic: float
    operation_mode: str
    speed_ratio: float
    collision: str
    programs: dict[str, str]
    holder: Holder | None
    lead_through: dict[str, bool | None]
    """None if the controller has no such resource."""

    @property
    def ours(self) -> bool:
        """Return whether both tasks run our motion servers."""
        return self.programs == PROGRAMS

    @property
    def program_names(self) -> str:
        """Return the names of the programs loaded."""
        return " and ".join(sorted({name or "no program" for name in self.programs.values()}))


class Sample(NamedTuple):
    """State of the robot: start of reading (monotonic), joints (rad, axes 1 to 7), flange in the robot's frame."""

    monotonic: float
    control_state: str
    running: bool
    joints: dict[str, list[float]]
    targets: dict[str, RobTarget]
    speeds: dict[str, float]

    @property
    def moving(self) -> bool:
        """Return whether an arm moves."""
        return max(self.speeds.values()) > STANDSTILL_SPEED


def read_panel(rws: Rws) -> Panel:
    """Read the state that a person changes."""
    parts = {field: read(rws) for field, read in PARTS.items()}
    return Panel(time.monotonic(), **parts)


def _speed_ratio(rws: Rws) -> float:
    ratio = rws.value("/rw/panel/speedratio", "speedratio")
    try:
        return float(ratio) / 100.0
    except ValueError:
        raise ConnectionLost("{device} returned an invalid speed ratio.", ratio, device=rws.who) from None


def holder(rws: Rws) -> Holder | None:
    """Return the client that has mastership of RAPID, or None."""
    states = rws.get("/rw/mastership/rapid")
    if not states or states[0].get("mastership", "nomaster") == "nomaster":
        return None
    return Holder(*(states[0].get(field, "") for field in Holder._fields))


def _program(rws: Rws, task: str) -> str:
    try:
        return rws.value(f"/rw/rapid/tasks/{task}/program", "name")
    except Refused:  # no program loaded
        return ""


def lead_through_path(unit: str) -> str:
    """Return the path of the lead-through resource of a mechanical unit."""
    return f"/rw/motionsystem/mechunits/{unit}/lead-through"


def _lead_through(rws: Rws, unit: str) -> bool | None:
    try:
        return rws.value(lead_through_path(unit), "status").lower() == "active"
    except Refused:
        return None


PARTS: Final[Mapping[str, Callable[[Rws], Any]]] = {
    "operation_mode": lambda rws: rws.value("/rw/panel/opmode", "opmode"),
    "speed_ratio": _speed_ratio,
    "collision": lambda rws: rws.value("/rw/panel/coldetstate", "coldetstate"),
    "programs": lambda rws: {arm: _program(rws, task) for arm, task in TASKS.items()},
    "holder": holder,
    "lead_through": lambda rws: {arm: _lead_through(rws, unit) for arm, unit in UNITS.items()},
}
"""Fields of the panel. One is read after each sample, because reading all of them would delay the next sample."""


def read_running(rws: Rws) -> bool:
    """Return whether RAPID runs."""
    return rws.value("/rw/rapid/execution", "ctrlexecstate") == "running"


def read_joints(fields: Fields) -> list[float]:
    """Return the joints of a jointtarget, rad; axis 7 is eax_a."""
    names = [*(f"rax_{number}" for number in range(1, 7)), "eax_a"]
    return to_radians(float(fields[name]) for name in names)


def read_target(fields: Fields) -> RobTarget:
    """Return a robtarget; its eax_a is the arm angle."""
    pose = pose_from(
        [float(fields[name]) for name in ("x", "y", "z")], [float(fields[f"q{number}"]) for number in range(1, 5)]
    )
    configuration = Configuration(*(int(float(fields[name])) for name in ("cf1", "cf4", "cf6", "cfx")))
    return RobTarget(pose, configuration, to_radians([float(fields["eax_a"])])[0])


class Observer(StateObserver[Sample]):
    """Observes the controller. `on_sample` is called after each reading on the observing thread."""

    busy_period = 0.02

    def __init__(self, name: str, settings: YumiSettings) -> None:
        self.rws = Rws(name, settings.host, settings.rws_port, settings.user, settings.password)
        self.period, self.fresh_for = settings.poll_period, max(MAX_SAMPLE_AGE, 3.0 * settings.poll_period)
        super().__init__(self.rws.who)
        self.version = ""
        self.on_sample: Callable[[Sample], None] = lambda _: None
        self._panel: Panel | None = None
        self._before: Sample | None = None
        self._fields = itertools.cycle(PARTS)

    def leave(self) -> None:
        """Send no further requests; call `disconnect` afterwards."""
        self._ending = True
        self.hurry()

    def disconnect(self) -> None:
        """Stop observing and end the session."""
        online = self.observing.online
        super().disconnect()
        if online:
            self.rws.logout()

    def sample(self) -> Sample:
        """Return the latest sample. Raise NotConnected, ConnectionLost, or Stale if it is too old."""
        return self.current().value

    def panel(self) -> Panel:
        """Return the latest panel. Raise as `sample`."""
        self.sample()
        assert self._panel is not None
        return self._panel

    @property
    def known_panel(self) -> Panel | None:
        """Return the latest panel, even if it is outdated."""
        return self._panel

    def note(self, panel: Panel) -> None:
        """Store a panel that was read elsewhere."""
        self._panel = panel

    # -------------------------------------------------------------------------------- on the observing thread
    def open(self, timeout: float) -> Snapshot[Sample]:
        """Read version, panel and state of the controller."""
        with self.rws.all_until(time.monotonic() + timeout):
            self.version = self.rws.get("/rw/system", FIRST_ANSWER_TIMEOUT)[0].get("rwversion", "")
            if not self.version.startswith("6."):
                version = self.version or "?"
                raise Refused(
                    "{device} has RobotWare {version}. This driver supports RobotWare 6 (RWS 1.0) only.",
                    device=self.who,
                    version=version,
                )
            self._before = None
            self._panel = read_panel(self.rws)
            return Snapshot.by(self.read)

    def close(self) -> None:
        """Close the connection, but not the session at the controller."""
        self.rws.close()

    def after_reading(self) -> None:
        """Pass the sample on, and read the next part of the panel."""
        if (newest := self.newest()) is not None:
            self.on_sample(newest)
        self._check_not_leaving()
        assert self._panel is not None
        field, before = next(self._fields), self._panel
        found = PARTS[field](self.rws)
        if self._panel is before:  # otherwise another thread has read the panel in the meantime
            self._panel = before._replace(monotonic=time.monotonic(), **{field: found})

    def _check_not_leaving(self) -> None:
        if self.ending:
            raise NotConnected("{device} is being disconnected.", device=self.who)

    def read(self) -> Sample:
        """Read the state of the robot."""
        started, rws = time.monotonic(), self.rws
        self._check_not_leaving()
        state = rws.value("/rw/panel/ctrlstate", "ctrlstate")
        self._check_not_leaving()
        running = read_running(rws)
        joints, targets = {}, {}
        for arm, unit in UNITS.items():
            place = f"/rw/motionsystem/mechunits/{unit}"
            self._check_not_leaving()
            jointtarget = rws.get(f"{place}/jointtarget")
            self._check_not_leaving()
            robtarget = rws.get(f"{place}/robtarget", tool="tool0", wobj="wobj0", coordinate="World")
            try:
                joints[arm], targets[arm] = read_joints(jointtarget[0]), read_target(robtarget[0])
            except (IndexError, KeyError, ValueError):
                raise ConnectionLost(
                    "{device} returned an invalid position of {unit}.",
                    f"{jointtarget} {robtarget}",
                    device=self.who,
                    unit=unit,
                ) from None
        self._before = Sample(started, state, running, joints, targets, self._speeds(started, joints))
        return self._before

    def _speeds(self, now: float, joints: dict[str, list[float]]) -> dict[str, float]:
        last = self._before
        if last is None:
            return dict.fromkeys(ARMS, 0.0)
        spent = max(now - last.monotonic, 1e-3)
        return {
            arm: max(abs(b - a) for a, b in zip(last.joints[arm], joints[arm], strict=True)) / spent for arm in ARMS
        }
