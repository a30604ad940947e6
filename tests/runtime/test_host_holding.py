"""Hold-to-run in the cell host: leases, their expiry, speed and joint limits, hand teaching."""

import contextlib
import os
import re
import signal
import time
from collections.abc import Iterator
from typing import Any

import psutil
import pytest

from arcor2_hw.data.operation import HoldKind
from arcor2_hw.data.robot import Joint
from arcor2_hw.runtime import messages as m

from .conftest import HostProcess, open_scene, scene_object, type_code

ARM = """
from arcor2_hw.exceptions import Arcor2NotImplemented

class Arm(Robot):
    _ABSTRACT = False

    def __init__(self, obj_id, name, pose, settings=None):
        super().__init__(obj_id, name, pose, settings)
        self.calls = []
        self.owner = None
        self.taking = 0.0
        self.hangs = 0.0
        self.at = 0.0
        self.fault = ""
        self.hand = False

    def note(self, call, *more): self.calls.append([call, time.monotonic(), *more])
    def report(self): return self.calls
    def forget(self):
        self.calls, self.taking, self.hangs, self.at, self.fault = [], 0.0, 0.0, 0.0, ""
    def set(self, key: str, value: float): setattr(self, key, value)
    def set_fault(self, fault: str): self.fault = fault
    def lose_control(self): self.owner = None
    def take_control(self):
        time.sleep(self.taking)
        self.owner = "us"
    def control_owner(self): return self.owner
    def get_end_effectors_ids(self): return {"tool"}
    def get_end_effector_pose(self, end_effector): return Pose()
    def robot_joints(self, include_gripper=False): return [Joint("turn", self.at), Joint("free", 0.0)]
    def joint_limits(self): return {"turn": (-1.0, 1.0)}
    def forward_kinematics(self, end_effector_id, joints):
        turn = joints[0].value
        return Pose(Position(0.8 * turn, 0.0, 0.0))  # a lever of 0.8 m that is almost straight
    def grippers(self): return set()
    def suctions(self): return set()
    def stop(self):
        self.note("stop")
        if self.hand: self.set_hand_teaching_mode(False)
    def get_hand_teaching_mode(self): return self.hand
    def set_hand_teaching_mode(self, enabled):
        if self.fault: raise SafetyStop(self.fault)
        self.hand = enabled
        self.note("hand", enabled)
    def jog(self, twist=None, joint_velocities=None, frame="world", valid_for=0.2, end_effector_id=None):
        if self.fault: raise SafetyStop(self.fault)
        self.note("jog", twist, joint_velocities, frame, valid_for, end_effector_id)
        time.sleep(self.hangs)
        self.note("jogged")
"""
OBJ = "obj_arm"
LONG = 2.0
"""Validity of a lease that lasts until it is renewed or the button is released, s. Joints slow down when a limit is
closer than this time."""
ALONG_X = (0.1, 0.0, 0.0, 0.0, 0.0, 0.0)


class Holder:
    """Send leases like the server."""

    def __init__(self, host: HostProcess) -> None:
        self.host = host
        self.hold = 0
        self._number = 10_000

    def lease(self, valid: float = LONG, *, kind: HoldKind = HoldKind.JOG, new: bool = False, **more: Any) -> int:
        self.hold += new
        self._number += 1
        if kind is HoldKind.JOG and valid and "joints" not in more:
            more.setdefault("twist", ALONG_X)
        until = time.monotonic() + valid if valid else 0.0
        self.host.send(m.Lease(self._number, OBJ, self.hold, kind, until, **more))
        return self._number

    def granted(self, valid: float = LONG, **more: Any) -> float:
        answer = self.host.answer(self.lease(valid, **more))
        assert isinstance(answer, dict), answer
        return float(answer["scale"])

    def refused(self, valid: float = LONG, **more: Any) -> m.ErrorData:
        answer = self.host.answer(self.lease(valid, **more))
        assert isinstance(answer, m.ErrorData), answer
        return answer

    def hold_once(self, valid: float) -> float:
        """Send one lease of new holds until the host accepts it. Return the monotonic time of sending, s.

        If the lease expires before it arrives, as on a busy computer, another hold is started.
        """
        while True:
            start = time.monotonic()
            answer = self.host.answer(self.lease(valid, new=True))
            if not isinstance(answer, m.ErrorData) or "had expired" not in answer.message.text:
                return start

    @contextlib.contextmanager
    def frozen(self) -> Iterator[None]:
        """Suspend the host in this context."""
        pid = self.host.process.pid
        os.kill(pid, signal.SIGSTOP)
        while psutil.Process(pid).status() != psutil.STATUS_STOPPED:
            time.sleep(0.001)
        try:
            yield
        finally:
            os.kill(pid, signal.SIGCONT)

    def wait_for_end(self) -> m.HoldEnded:
        known = [e for e in self.host.seen if isinstance(e, m.HoldEnded) and e.hold == self.hold]
        return known[0] if known else self.host.expect(m.HoldEnded, lambda e: e.hold == self.hold)

    def calls(self, *names: str) -> list[list[Any]]:
        return [one for one in self.host.call(OBJ, "report") if not names or one[0] in names]


@pytest.fixture(scope="module", params=[False, True], ids=["in the cell host", "in a separate process"])
def hosted(request: pytest.FixtureRequest) -> Iterator[Holder]:
    host = HostProcess()
    source = ARM.replace("_ABSTRACT = False", f"_ABSTRACT = False; own_process = {request.param}")
    host.send(open_scene([type_code("Arm", source)], scene_object("arm", "Arm", pose=True)))
    host.expect(m.SceneOpened)
    yield Holder(host)
    host.end()


@pytest.fixture
def holder(hosted: Holder) -> Holder:
    hosted.host.call(OBJ, "forget")
    return hosted


def test_the_robot_moves_while_leases_are_renewed(holder: Holder) -> None:
    assert holder.granted(new=True) == 1.0
    for _ in range(8):
        time.sleep(0.3)
        holder.granted()
    assert holder.host.answer(holder.lease(0.0)) is None
    ended = holder.wait_for_end()
    assert ended.error is None
    jogs, stops = holder.calls("jog"), holder.calls("stop")
    assert len(jogs) == 9
    assert all(tuple(jog[2]) == ALONG_X and jog[4] == "world" and 0.1 < jog[5] <= LONG for jog in jogs)
    assert len(stops) == 1
    assert stops[0][1] > jogs[-1][1]


def test_an_expired_hold_stops_and_does_not_start_again(holder: Holder) -> None:
    start = holder.hold_once(0.15)
    ended = holder.wait_for_end()
    assert ended.error is not None
    assert "not renewed in time" in ended.error.message.text
    assert "arm" in ended.error.message.text
    (stop,) = holder.calls("stop")
    assert stop[1] - start >= 0.15
    assert "has ended" in holder.refused().message.text
    assert len(holder.calls("jog")) == 1
    holder.granted(new=True)
    holder.lease(0.0)
    holder.wait_for_end()


def test_a_late_lease_is_refused(holder: Holder) -> None:
    """The host hangs longer than the duration of the queued leases."""
    with holder.frozen():
        late = [holder.lease(0.1, new=True)] + [holder.lease(0.1) for _ in range(4)]
        time.sleep(0.3)
    for number in late:
        error = holder.host.answer(number)
        assert isinstance(error, m.ErrorData)
        assert "had expired" in error.message.text
    assert holder.calls("jog") == []


def test_a_lease_that_arrives_after_a_freeze_does_not_resume_an_expired_hold(holder: Holder) -> None:
    for _ in range(4):  # either the thread that reads leases or the one that ends them runs first
        holder.hold_once(0.5)
        with holder.frozen():
            time.sleep(0.6)
            renewal = holder.lease()
        error = holder.host.answer(renewal)
        assert isinstance(error, m.ErrorData)
        assert re.search("not renewed in time|motion has ended", error.message.text)
        holder.wait_for_end()
    assert len(holder.calls("jog")) == 4


def test_a_second_hold_of_a_robot_is_refused(holder: Holder) -> None:
    holder.granted(new=True)
    holder.hold += 1
    assert "already moving" in holder.refused().message.text
    holder.hold -= 1
    holder.lease(0.0)
    holder.wait_for_end()


def test_motion_starts_after_slow_control_only_if_the_hold_continues(holder: Holder) -> None:
    holder.host.call(OBJ, "set", key="taking", value=0.6)
    holder.host.call(OBJ, "lose_control")
    numbers = [holder.lease(new=True)]
    for _ in range(9):
        time.sleep(0.1)
        numbers.append(holder.lease())
    assert all(holder.host.answer(number) == {"scale": 1.0} for number in numbers)
    assert len(holder.calls("jog")) < len(numbers)  # leases that arrived meanwhile are merged into one
    holder.lease(0.0)
    holder.wait_for_end()

    holder.host.call(OBJ, "forget")
    holder.host.call(OBJ, "set", key="taking", value=0.6)
    holder.host.call(OBJ, "lose_control")
    holder.hold_once(0.2)
    error = holder.wait_for_end().error
    assert error is not None
    assert "not renewed" in error.message.text
    assert holder.calls("jog") == []


def test_a_stop_reaches_a_robot_whose_driver_hangs(holder: Holder) -> None:
    holder.host.call(OBJ, "set", key="hangs", value=1.5)
    start = holder.hold_once(0.2)
    ended = holder.wait_for_end()
    assert ended.error is not None
    calls = holder.calls()
    assert [call[0] for call in calls[:3]] == ["jog", "stop", "jogged"]
    assert calls[1][1] - start >= 0.2


def test_a_stop_ends_the_hold(holder: Holder) -> None:
    holder.granted(new=True)
    holder.host.send(m.StopMotion(77, OBJ))
    assert holder.host.answer(77) is None
    ended = holder.wait_for_end()
    assert ended.error is not None
    assert "was stopped" in ended.error.message.text
    assert holder.refused().message.text


def test_an_error_of_the_driver_ends_the_hold(holder: Holder) -> None:
    holder.granted(new=True)
    holder.host.call(OBJ, "set_fault", fault="protective stop of 192.0.2.1")
    assert "protective stop" in holder.refused().message.text
    ended = holder.wait_for_end()
    assert ended.error is not None
    assert (ended.error.code, ended.error.object_id) == ("safety_stop", OBJ)
    assert holder.calls("stop")
    assert "protective stop" in holder.refused(new=True).message.text
    holder.wait_for_end()


def test_the_end_effector_never_exceeds_the_reduced_speed(holder: Holder) -> None:
    assert holder.granted(new=True, twist=(0.3, 0.0, 0.4, 0.0, 0.0, 1.0)) == pytest.approx(0.5)
    assert holder.granted(joints=[Joint("turn", 0.1)]) == 1.0
    scale = holder.granted(joints=[Joint("turn", 1.0)])
    assert 0.9 * 0.25 <= scale * 1.0 * 0.8 <= 0.25
    first, _, last = holder.calls("jog")
    assert first[2] == pytest.approx([0.15, 0.0, 0.2, 0.0, 0.0, 0.5])
    assert last[2] is None
    assert last[3] == pytest.approx([scale, 0.0])
    holder.lease(0.0)
    holder.wait_for_end()


def test_a_joint_slows_down_before_its_limit_and_stops_there(holder: Holder) -> None:
    holder.host.call(OBJ, "set", key="at", value=0.95)
    scale = holder.granted(new=True, joints=[Joint("turn", 0.25)])
    assert 0.0 < scale * 0.25 * LONG < 0.05
    assert holder.granted(joints=[Joint("turn", -0.25)]) == 1.0
    holder.host.call(OBJ, "set", key="at", value=0.995)
    error = holder.refused(joints=[Joint("turn", 0.25)])
    assert "the joint turn is at its upper limit" in error.message.text
    holder.wait_for_end()
    assert holder.granted(new=True, joints=[Joint("turn", -0.25)]) == 1.0
    holder.lease(0.0)
    holder.wait_for_end()


def test_a_twist_slows_down_before_a_joint_limit(holder: Holder) -> None:
    assert holder.granted(new=True) == 1.0
    time.sleep(0.1)
    holder.host.call(OBJ, "set", key="at", value=0.95)
    assert holder.granted() < 0.9  # because of the distance moved since the last lease
    time.sleep(0.1)
    holder.host.call(OBJ, "set", key="at", value=0.999)
    assert "turn is at its upper limit" in holder.refused().message.text
    holder.wait_for_end()
    assert holder.granted(new=True) < 0.1  # the direction is not known yet
    holder.host.call(OBJ, "set", key="at", value=0.9)
    holder.granted()
    holder.lease(0.0)
    holder.wait_for_end()


@pytest.mark.parametrize(
    ("more", "text"),
    [
        ({"joints": [Joint("elbow", 0.1)]}, "no joint elbow"),
        ({"end_effector_id": "claw"}, "no end effector 'claw'"),
    ],
)
def test_unknown_joints_and_end_effectors_are_refused(holder: Holder, more: Any, text: str) -> None:
    assert text in holder.refused(new=True, **more).message.text
    holder.wait_for_end()
    assert holder.calls("jog") == []


def test_hand_teaching_lasts_while_it_is_held(holder: Holder) -> None:
    for number in range(3):
        holder.granted(1.5, kind=HoldKind.HAND_TEACHING, new=number == 0)
    ended = holder.wait_for_end()
    assert ended.error is not None
    assert [one[2] for one in holder.calls("hand")] == [True, False]
    assert holder.host.call(OBJ, "get_hand_teaching_mode") is False
    holder.granted(kind=HoldKind.HAND_TEACHING, new=True)
    assert holder.host.answer(holder.lease(0.0, kind=HoldKind.HAND_TEACHING)) is None
    assert holder.host.call(OBJ, "get_hand_teaching_mode") is False


ARMS = """
from arcor2_hw.objects import MultiArmRobot

class Arms(MultiArmRobot):
    _ABSTRACT = False
    def __init__(self, obj_id, name, pose, settings=None):
        super().__init__(obj_id, name, pose, settings)
        self.calls = []
    def report(self): return self.calls
    def get_arm_ids(self): return {"left", "right"}
    def get_end_effectors_ids(self, arm_id=None): return {"claw", "cup"} if arm_id == "right" else {"claw"}
    def get_end_effector_pose(self, end_effector, arm_id=None): return Pose()
    def robot_joints(self, include_gripper=False, arm_id=None): return [Joint(f"{arm_id}_turn", 0.0)]
    def grippers(self, arm_id=None): return set()
    def suctions(self, arm_id=None): return set()
    def stop(self, arm_id=None): self.calls.append(["stop"])
    def get_hand_teaching_mode(self, arm_id=None): return False
    def set_hand_teaching_mode(self, enabled, arm_id=None): self.calls.append(["hand", enabled, arm_id])
    def tcp_speed(self, joint_velocities, end_effector_id=None, arm_id=None): return 0.5 * abs(joint_velocities[0])
    def jog(self, twist=None, joint_velocities=None, frame="world", valid_for=0.2, end_effector_id=None, arm_id=None):
        self.calls.append(["jog", twist, joint_velocities, end_effector_id, arm_id])
"""


def test_a_hold_moves_one_of_several_arms(host: HostProcess) -> None:
    host.send(open_scene([type_code("Arms", ARMS)], scene_object("arm", "Arms", pose=True)))
    host.expect(m.SceneOpened)
    holder = Holder(host)
    assert holder.granted(new=True, arm_id="left") == 1.0
    assert 0.45 < holder.granted(joints=[Joint("left_turn", 1.0)], arm_id="left") <= 0.5
    holder.lease(0.0, arm_id="left")
    holder.wait_for_end()
    assert "Select one of claw, cup." in holder.refused(new=True, arm_id="right").message.text
    holder.wait_for_end()
    assert holder.granted(new=True, arm_id="right", end_effector_id="cup") == 1.0
    holder.lease(0.0, arm_id="right")
    holder.wait_for_end()
    holder.granted(kind=HoldKind.HAND_TEACHING, new=True, arm_id="right")
    holder.lease(0.0, kind=HoldKind.HAND_TEACHING)
    holder.wait_for_end()
    calls = [call for call in host.call(OBJ, "report") if call[0] != "stop"]
    assert [call[-1] for call in calls] == ["left", "left", "right", "right", "right"]
    assert calls[1][2] == pytest.approx([0.475])
    assert calls[2][3] == "cup"
    assert calls[3:] == [["hand", True, "right"], ["hand", False, "right"]]


def test_the_host_stops_held_robots_when_the_server_ends() -> None:
    host = HostProcess()
    try:
        host.send(open_scene([type_code("Arm", ARM)], scene_object("arm", "Arm", pose=True)))
        host.expect(m.SceneOpened)
        holder = Holder(host)
        holder.granted(new=True)
        host.socket.close()
        assert host.gone() == 0
    finally:
        host.end()
