"""Recordings of the cell host, and their state after the host or the server was killed."""

import time
from pathlib import Path

from msgspec import UNSET

from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.project import Action, ActionPoint, Project
from arcor2_hw.data.recordings import RecordedValues
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.ring_records import converted
from arcor2_server.storage.recordings import RecordingFiles

from .conftest import HostProcess, Package, open_scene, scene_object, type_code

LIFT = """
from arcor2_hw.data.device import Connection, Observation
from arcor2_hw.objects.state_observer import Snapshot, StateObserver

class Counter(StateObserver):
    period = busy_period = 0.01
    def open(self, timeout):
        self.count = 0
        return Snapshot.by(self.read)
    def read(self):
        self.count += 1
        return self.count // 10

class Lift(Robot):
    _ABSTRACT = False

    def __init__(self, obj_id, name, pose):
        super().__init__(obj_id, name, pose)
        self.counter = Counter(name)

    def connect(self, timeout=1.0): self.counter.connect(timeout)
    def disconnect(self): self.counter.disconnect()
    @property
    def connection(self): return self.counter.observing.state
    def observations(self): return [Observation("count", self.counter.current().value)]
    @property
    def shown_values(self): return {"gripped": 1.0}
    def take_control(self): pass
    def get_end_effectors_ids(self): return {"tool"}
    def get_end_effector_pose(self, end_effector): return Pose(Position(0.1, 0.2, 0.3))
    def robot_joints(self, include_gripper=False): return [Joint("height", time.monotonic())]
    def grippers(self): return set()
    def suctions(self): return set()
    def stop(self): pass

    @action
    def nap(self, seconds: float, *, an: str | None = None) -> bool:
        time.sleep(seconds)
        return True

    @action
    def fail(self, *, an: str | None = None) -> None:
        raise Refused("the lift is full")
"""
PROJECT = Project(
    "project",
    "scn_1",
    id="pro_1",
    action_points=[
        ActionPoint("top", Position(), id="acp", actions=[Action(n, "obj_lift/nap", f"act_{n}") for n in "abc"])
    ],
)
BODY = """
lift = res.objects["obj_lift"]
lift.nap(0.5, an="a")
try:
    lift.fail(an="b")
except Refused as error:
    res.caught(error)
lift.nap(1000.0, an="c")
"""


def running(host: HostProcess, package: Package, recordings: Path) -> None:
    """Start the program, and wait until its last action runs."""
    directory = package.write({"Lift": LIFT}, [scene_object("lift", "Lift", pose=True)], PROJECT, BODY)
    message = m.RunPackage("pkg_1", str(directory), streaming_period=0.02, run=3, recordings=str(recordings))
    host.send(message)
    host.expect(m.ProgramEvent, lambda event: event.name == "c")


def check(found: RecordedValues) -> None:
    """Check the recording up to the last action."""
    signals = {each.name: each for each in found.signals if each.object_id == "obj_lift"}
    assert set(signals) == {"count", "height", "connected", "gripped"}
    counted = [value for value in signals["count"].values if value is not None]
    assert counted == sorted(counted)
    assert len(counted) > 2
    assert len(signals["height"].values) > 5
    assert signals["connected"].values[-1] is True
    assert signals["gripped"].values == [True]
    a, b, c = found.actions
    assert (a.name, a.action_id, a.object_name, a.results) == ("a", "act_a", "lift", ["true"])
    assert (b.name, b.error) == ("b", "the lift is full")
    assert c.name == "c"
    assert not isinstance(a.end, Unset)
    assert not isinstance(b.end, Unset)
    assert a.begin < a.end <= b.begin <= b.end <= c.begin


def test_the_ring_of_a_killed_host_is_complete(host: HostProcess, package: Package, tmp_path: Path) -> None:
    running(host, package, tmp_path / "recordings")
    host.process.kill()
    host.gone()
    moment = time.monotonic()
    found, begin = converted([host.ring.segments()], moment, moment - 60.0, moment)
    assert begin > -60_000
    check(found)
    assert not (tmp_path / "recordings").exists()


def test_a_host_stores_the_run_that_the_end_of_the_server_interrupts(
    host: HostProcess, package: Package, tmp_path: Path
) -> None:
    recordings = tmp_path / "recordings"
    running(host, package, recordings)
    host.socket.close()
    host.gone()
    [saved] = RecordingFiles(recordings).saved_rings()
    assert saved.run == 3
    assert saved.monotonic <= time.monotonic()
    check(converted(saved.rings, saved.monotonic, saved.monotonic - 60.0, saved.monotonic)[0])


def test_a_run_that_has_ended_is_not_stored_by_its_host(host: HostProcess, package: Package, tmp_path: Path) -> None:
    recordings = tmp_path / "recordings"
    directory = package.write({"Lift": LIFT}, [scene_object("lift", "Lift", pose=True)], PROJECT, "pass")
    host.send(m.RunPackage("pkg_1", str(directory), run=3, recordings=str(recordings)))
    host.expect_state("stopped")
    host.socket.close()
    host.gone()
    assert not recordings.exists()


def test_commands_of_users_in_an_online_scene_are_recorded(host: HostProcess) -> None:
    host.send(open_scene([type_code("Lift", LIFT)], scene_object("lift", "Lift", pose=True)))
    host.expect(m.SceneOpened)
    for number, method in ((1, "nap"), (2, "fail"), (3, "robot_joints"), (4, "unknown")):
        arguments = {"seconds": b"0.01"} if method == "nap" else {}
        host.send(m.Call(number, "obj_lift", method, arguments, control=method != "robot_joints"))
        host.answer(number)
    moment = time.monotonic()
    found, _ = converted([host.ring.segments()], moment, moment - 60.0, moment)
    assert [(each.number, each.name, each.error) for each in found.actions] == [
        (-1, "lift: nap", UNSET),
        (-2, "lift: fail", "the lift is full"),
    ]
