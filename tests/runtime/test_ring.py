"""The ring of recent values: its segments, and the recorder that fills it."""

import os
import threading
import time
from types import SimpleNamespace
from typing import Any

import pytest
from msgspec import UNSET

from arcor2_hw.data.device import Connection, Health, Observation
from arcor2_hw.data.position import Frame
from arcor2_hw.data.recordings import SignalKind
from arcor2_hw.data.robot import Joint
from arcor2_hw.messages import Message
from arcor2_hw.runtime import ring as ring_module
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.messages import DeviceChanged
from arcor2_hw.runtime.recorder import Recorder
from arcor2_hw.runtime.ring import SEGMENTS, Ring, create, records
from arcor2_hw.runtime.ring_records import converted


def thing(name: str) -> Any:
    return SimpleNamespace(id=f"obj_{name}", name=name)


class Clock:
    """The monotonic clock, set by the test."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 1000.0
        monkeypatch.setattr(time, "monotonic", lambda: self.now)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def content(ring: Ring) -> list[bytes]:
    return [bytes(record) for segment in ring.segments() for record in records(segment)]


def test_the_oldest_segment_is_overwritten() -> None:
    ring = Ring()
    assert not ring.append(b"before the first segment")
    for number in range(SEGMENTS + 2):
        ring.begin_segment()
        assert ring.append(b"%d" % number)
        assert ring.append(b"")
    assert [record for record in content(ring) if record] == [b"%d" % number for number in range(2, SEGMENTS + 2)]


def test_a_record_that_does_not_fit_leaves_the_segment_unchanged() -> None:
    ring = Ring()
    ring.begin_segment()
    assert ring.append(b"a" * (ring_module.ROOM - 8))
    assert not ring.append(b"b")
    assert ring.append(b"")
    assert [len(record) for record in content(ring)] == [ring_module.ROOM - 8, 0]


def test_a_second_mapping_of_the_memory_reads_records_during_writing() -> None:
    descriptor = create()
    reader = Ring(os.dup(descriptor))
    writer = Ring(descriptor)
    stop = threading.Event()

    def write() -> None:
        number = 0
        while not stop.is_set():
            number += 1
            if not writer.append(b"%09d" % number * 50):
                writer.begin_segment()

    thread = threading.Thread(target=write)
    thread.start()
    try:
        for _ in range(30):
            for segment in reader.segments():
                numbers = [int(bytes(record)[:9]) for record in records(segment)]
                assert numbers == list(range(numbers[0], numbers[0] + len(numbers))) if numbers else True
    finally:
        stop.set()
        thread.join()


def test_hosts_may_use_the_same_action_numbers(clock: Clock) -> None:
    """The main host runs a program; users call a device of each host."""
    hosts = [Recorder(Ring(), lambda: Cell()), Recorder(Ring(), lambda: Cell())]
    for name, recorder in zip(("near", "far"), hosts, strict=True):
        clock.now += 1.0
        recorder.observed(thing(name), [Observation("level", 1.0)], clock.now)
        recorder.action_started(-1, name, f"obj_{name}")
    hosts[0].action_started(1, "pick", "obj_near")
    clock.now += 1.0
    hosts[1].action_ended(-1)
    found, begin = converted([each._ring.segments() for each in hosts if each._ring], clock.now, 0.0, clock.now)
    assert begin == -2000
    assert [(each.object_name, each.times) for each in found.signals] == [("near", [-2000]), ("far", [-1000])]
    assert len({each.number for each in found.actions}) == 3
    assert [(each.name, each.end) for each in found.actions] == [("near", UNSET), ("far", 0), ("pick", UNSET)]
    assert next(each.number for each in found.actions if each.name == "pick") == 1


def test_values_joints_and_actions_become_columns(clock: Clock) -> None:
    ring = Ring()
    recorder = Recorder(ring)
    robot, io = thing("robot"), thing("io")
    recorder.observed(io, [Observation("part", False), Observation("level", 0.25, "m")], clock.now)
    recorder.joints(robot, [Joint("j1", 0.1), Joint("j2", 1.0)])
    clock.now += 1.0
    recorder.action_started(1, "pick", "obj_robot", [Frame("act_pick")])
    clock.now += 1.0
    recorder.observed(io, [Observation("part", True), Observation("level", 0.25, "m")], clock.now)
    recorder.joints(robot, [Joint("j1", 0.1 + 1e-6), Joint("j2", 2.0)])
    recorder.action_ended(1, 0.5, event=b'{"event":"ActionStateAfter","data":{"action_id":"a","results":["true"]}}')
    recorder.action_started(2, "place", "obj_robot")
    recorder.action_started(3, "wait", "")
    clock.now += 1.0
    recorder.action_ended(2, error=Message.of("{what} is full", what="box"))
    recorder.action_ended(99)  # its start is not known
    found, begin = converted([ring.segments()], clock.now, clock.now - 60.0, clock.now)
    assert begin == -3000
    columns = {(each.object_name, each.name): (each.times, each.values, each.unit, each.kind) for each in found.signals}
    assert columns == {
        ("io", "part"): ([-3000, -1000], [False, True], "", SignalKind.POINT),
        ("io", "level"): ([-3000], [0.25], "m", SignalKind.POINT),
        ("robot", "j1"): ([-3000], [0.1], "", SignalKind.JOINT),
        ("robot", "j2"): ([-3000, -1000], [1.0, 2.0], "", SignalKind.JOINT),
    }
    pick, place, wait = found.actions
    assert (pick.name, pick.action_id, pick.begin, pick.end, pick.results) == (
        "pick",
        "act_pick",
        -1500,
        -1000,
        ["true"],
    )
    assert (place.begin, place.end, place.error) == (-1000, 0, "box is full")
    assert place.error_message == Message.of("{what} is full", what="box")
    assert (wait.begin, wait.end) == (-1000, UNSET)


def test_values_that_have_not_changed_for_long_are_known_and_older_changes_are_cut(clock: Clock) -> None:
    ring = Ring()
    recorder = Recorder(ring)
    still, moving = thing("still"), thing("moving")
    recorder.observed(still, [Observation("on", True)], clock.now)
    recorder.action_started(7, "long", "")
    for second in range(600):
        clock.now += 1.0
        recorder.observed(moving, [Observation("count", float(second))], clock.now)
    found, begin = converted([ring.segments()], clock.now, clock.now - 60.0, clock.now)
    assert begin == -60_000
    on, count = sorted(found.signals, key=lambda each: each.object_name, reverse=True)
    assert on.values == [True]
    assert on.times[0] <= -60_000
    assert count.values == [float(second) for second in range(539, 600)]
    assert [action.name for action in found.actions] == ["long"]


def test_more_values_than_fit_shorten_the_recorded_time(clock: Clock) -> None:
    ring = Ring()
    recorder = Recorder(ring)
    source = thing("noisy")
    names = [f"value {number}" for number in range(200)]
    for step in range(6000):
        clock.now += 0.01
        recorder.observed(source, [Observation(name, step + 0.5) for name in names], clock.now)
    found, begin = converted([ring.segments()], clock.now, clock.now - 60.0, clock.now)
    assert -60_000 < begin < -1000
    assert len(found.signals) == 200
    assert all(each.values[-1] == 5999.5 for each in found.signals)


def test_a_damaged_record_hides_no_other(clock: Clock) -> None:
    ring = Ring()
    recorder = Recorder(ring)
    recorder.observed(thing("a"), [Observation("x", 1.0)], clock.now)
    ring.append(b"\xc1 not a record")
    recorder.observed(thing("b"), [Observation("y", float("nan"))], clock.now)
    found, _ = converted([ring.segments()], clock.now, clock.now - 60.0, clock.now)
    assert [(each.name, each.values) for each in found.signals] == [("x", [1.0]), ("y", [None])]


def test_shown_values_that_are_observations_are_recorded_once(clock: Clock) -> None:
    ring = Ring()
    recorder = Recorder(ring)
    recorder.observed(thing("belt"), [Observation("Velocity", 0.1, "m/s")], clock.now)
    values = {"velocity": 0.1, "door": 1.0}
    recorder.device_changed(DeviceChanged("obj_belt", Connection.LOST, Health.NORMAL, values=values))
    found, _ = converted([ring.segments()], clock.now, clock.now - 60.0, clock.now)
    assert [(each.name, each.values) for each in found.signals] == [
        ("Velocity", [0.1]),
        ("connected", [False]),
        ("door", [1.0]),
    ]


def test_a_new_state_is_converted_once_and_only_if_it_differs(clock: Clock) -> None:
    ring = Ring()
    jobs: list[Any] = []
    instance = SimpleNamespace(id="obj_io", name="io", observations=lambda: [Observation("part", True)])
    lane = SimpleNamespace(submit_or_fail=jobs.append)
    device: Any = SimpleNamespace(id="obj_io", name="io", instance=instance, up=True, watch_lane=lane)
    recorder = Recorder(ring, Cell)
    recorder.state_taken(device, {"part": True})
    recorder.state_taken(device, {"part": False})  # the first one is not converted yet
    assert len(jobs) == 1
    jobs[0].finish(None, None)
    clock.now += 1.0
    recorder.state_taken(device, {"part": True})  # nothing has changed since
    assert len(jobs) == 1
    recorder.state_taken(device, {"part": False})
    assert len(jobs) == 2
    Recorder().state_taken(device, {"part": True})  # without a ring nothing is read
    assert len(jobs) == 2
