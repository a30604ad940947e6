"""The Magician: observing, moving, stopping, picking, and the conveyor belt."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from arcor2_drivers.dobot_magician.dobot_magician import DobotMagician, DobotMoveType
from arcor2_drivers.dobot_magician.settings import DobotMagicianSettings
from arcor2_hw.data.device import Connection, Health, Identity, LossKind
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.robot import Joint, MoveEnd, ProgramState
from arcor2_hw.exceptions import Cancelled, DeviceFault, NotFound, NotInControl, OutOfRange, Refused
from tests.drivers.background_call import BackgroundCall
from tests.drivers.dobot_magician.conftest import BASE
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for

GETS_ONLY = {0, 1, 2, 10, 20, 246}
DOWN = Orientation(1.0, 0.0, 0.0, 0.0)


def at(x: float, y: float, z: float, r: float = 0.0) -> Pose:
    """Return a pose in the world for a tool position in the arm's base, in m and degrees."""
    turn = Orientation.from_rotation_vector(0.0, 0.0, math.radians(r))
    return BASE * Pose(Position(x, y, z), turn * DOWN)


def joints(*degrees: float) -> list[Joint]:
    return [Joint(f"joint_{i + 1}", math.radians(value)) for i, value in enumerate(degrees)]


def test_connecting_only_reads(fake: FakeProcess, make: Callable[..., DobotMagician]) -> None:
    arm = make(fake.ready["port"])
    assert arm.connection is Connection.OFFLINE
    arm.connect()
    arm.connect()  # has no effect when connected
    assert arm.connection is Connection.ONLINE
    assert arm.health is Health.NORMAL
    assert arm.identify() == Identity("Dobot", "Dobot Magician", "DT1022049091", "3.6.5")
    assert arm.alarms() == []
    pose = arm.get_end_effector_pose("tcp")
    tool = fake.truth()["tool"]
    assert list(pose.position) == pytest.approx(
        [0.4 + tool[0] / 1000, -0.2 + tool[1] / 1000, 0.138 + tool[2] / 1000], abs=1e-6
    )
    assert [joint.value for joint in arm.robot_joints()] == pytest.approx([0, math.pi / 4, math.pi / 4, 0], abs=1e-6)
    for act in (arm.home, lambda: arm.suck(True), lambda: arm.conveyor(0.1), lambda: arm.move(at(0.2, 0, 0))):
        with pytest.raises(NotInControl, match=r"^arm at .*ttyDOBOT: control is not taken\.$"):
            act()
    arm.stop()  # no motion by this client: sends nothing
    arm.disconnect()
    arm.disconnect()
    assert arm.connection is Connection.OFFLINE
    received = fake.truth()["received"]
    assert {command for command, _ in received} == GETS_ONLY
    assert {control for _, control in received} == {0}


def test_every_move_type_arrives(fake: FakeProcess, arm: DobotMagician) -> None:
    assert arm.control_owner() == "us"
    for move_type, place in (
        (DobotMoveType.LINEAR, (0.24, 0.06, 0.02, 30.0)),
        (DobotMoveType.JOINT, (0.22, -0.10, 0.05, -20.0)),
        (DobotMoveType.JUMP, (0.25, 0.05, 0.0, 0.0)),
    ):
        arm.move(at(*place), move_type, speed=1.0)
        tool = fake.truth()["tool"]
        assert tool == pytest.approx([place[0] * 1000, place[1] * 1000, place[2] * 1000, place[3]], abs=0.1)
        assert arm.last_move is not None
        assert arm.last_move.end is MoveEnd.DONE
        there = arm.get_end_effector_pose("tcp")
        assert there.position.distance_to(at(*place).position) < 1e-3
        assert there.orientation.angle_to(at(*place).orientation) < math.radians(0.5)
    arm.move_to(ProjectRobotJoints("there", "arm_id", joints(-30, 40, 50, 20)), 1.0)
    assert fake.truth()["joints"] == pytest.approx([-30, 40, 50, 20], abs=0.01)
    arm.move_to_pose("tcp", at(0.22, 0.0, 0.03), 1.0)
    arm.move_to_joints(joints(0, 45, 45, 0), 0.5)
    truth = fake.truth()
    assert truth["speed_ratio"] == 50.0
    assert truth["longest_queue"] == 1
    assert truth["motions"] == 6


def test_kinematics_agree_with_the_arm_and_name_unreachable_poses(fake: FakeProcess, arm: DobotMagician) -> None:
    pose = arm.forward_kinematics("tcp", joints(10, 50, 40, -15))
    arm.move_to_joints(joints(10, 50, 40, -15), 1.0)
    assert arm.get_end_effector_pose("tcp").position.distance_to(pose.position) < 1e-5
    solved = arm.inverse_kinematics("tcp", pose)
    assert [math.degrees(joint.value) for joint in solved] == pytest.approx([10, 50, 40, -15], abs=1e-6)
    motions = fake.truth()["motions"]
    for call, words in (
        (lambda: arm.move(at(0.6, 0.0, 0.0)), "arm cannot reach the pose: it is .* mm from the shoulder"),
        (lambda: arm.move(at(-0.2, 0.02, 0.0)), "joint_1 would be at 174.3°, beyond -90° to 90°"),
        (lambda: arm.move(BASE * Pose(Position(0.2, 0.0, 0.0))), "the tool can only point down"),
        (lambda: arm.pick(at(0.6, 0.0, 0.0)), "cannot reach"),
    ):
        with pytest.raises(DobotMagician.KinematicsException, match=words):
            call()
    with pytest.raises(DobotMagician.KinematicsException, match="joint_2 of arm must be"):
        arm.forward_kinematics("tcp", joints(0, 100, 0, 0))
    with pytest.raises(OutOfRange, match="joint_4 of arm must be"):
        arm.move_to_joints(joints(0, 45, 45, math.nan), 1.0)
    with pytest.raises(OutOfRange, match=r"^arm at .*: speed must be 0.01 to 1, not 1.5$"):
        arm.move_to_joints(joints(0, 45, 45, 0), 1.5)
    with pytest.raises(NotFound, match="no end effector 'hand'"):
        arm.get_end_effector_pose("hand")
    assert fake.truth()["motions"] == motions


def test_stop_overtakes_a_motion_and_drops_the_queue(
    fake: FakeProcess, arm: DobotMagician, wait_for: Callable[..., Any]
) -> None:
    doing = BackgroundCall(lambda: arm.pick(at(0.2, 0.15, 0.0), speed=0.02))
    fake.control.wait_until(lambda truth: truth["moving"])
    with pytest.raises(Refused, match="arm is moving already"):
        arm.move(at(0.2, 0.0, 0.0))
    assert arm.state().program in (ProgramState.PLAYING, ProgramState.STOPPED)
    arm.stop()
    outcome = doing.outcome()
    truth = fake.truth()
    assert isinstance(outcome, Cancelled)
    assert "a move of arm at" in str(outcome)
    assert truth["moving"] is False
    assert (truth["queued"], truth["running"], truth["motions"]) == (0, False, 1)
    order = [command for command, control in truth["received"] if control & 1]
    assert order[-2:] == [242, 245]  # force stop, then clear, and no start after it
    assert truth["suction"] == [0, 0]
    assert arm.last_move is not None
    assert arm.last_move.end is MoveEnd.STOPPED
    assert arm.control_owner() == "us"
    arm.move_to_joints(joints(0, 45, 45, 0), 1.0)  # the old motion is not completed first
    assert fake.truth()["joints"] == pytest.approx([0, 45, 45, 0], abs=0.01)
    assert fake.truth()["motions"] == 2


def test_pick_and_place_switch_the_suction_at_the_part(fake: FakeProcess, arm: DobotMagician) -> None:
    arm.set_part(0.03, 0.03, 0.02)
    arm.pick(at(0.22, 0.05, -0.02), approach=0.04, speed=1.0, slow_speed=0.5)
    truth = fake.truth()
    assert truth["suction"] == [1, 1]
    assert truth["tool"][2] == pytest.approx(20.0, abs=0.1)
    assert truth["motions"] == 3
    assert list(arm.parts) == ["part of arm"]
    assert arm.parts["part of arm"].in_link.position.z == pytest.approx(0.01), "the part is below the cup"
    arm.stop()
    assert fake.truth()["suction"] == [1, 1]  # a stop does not drop the part
    arm.place(at(0.22, -0.05, -0.02), approach=0.04, speed=1.0, slow_speed=0.5)
    assert fake.truth()["suction"] == [1, 0]
    assert arm.parts == {}
    arm.suck(True)
    assert fake.truth()["suction"] == [1, 1]
    arm.gripper(True)
    assert fake.truth()["gripper"] == [1, 1]
    assert arm.parts["part of arm"].in_link.position.z == 0.0, "between the fingers"
    arm.gripper(False)
    assert fake.truth()["gripper"] == [1, 0]
    assert fake.truth()["longest_queue"] == 1


def test_the_belt_runs_and_stops_with_the_arm(
    fake: FakeProcess, arm: DobotMagician, make: Callable[..., DobotMagician]
) -> None:
    arm.conveyor(0.05)
    assert fake.truth()["steppers"]["0"] == [True, 14147]
    arm.conveyor(-0.1)
    assert fake.truth()["steppers"]["0"] == [True, -28294]
    arm.stop()
    assert fake.truth()["steppers"]["0"] == [False, 0]
    arm.conveyor(0.05)
    arm.disconnect()
    assert fake.truth()["steppers"]["0"] == [False, 0]
    without = make(fake.ready["port"])
    without.connect()
    without.take_control()
    with pytest.raises(Refused, match="conveyor_port is not set"):
        without.conveyor(0.05)


def test_an_alarm_ends_a_motion_and_is_acknowledged(fake: FakeProcess, arm: DobotMagician) -> None:
    doing = BackgroundCall(lambda: arm.move_to_joints(joints(80, 45, 45, 0), 0.03))
    fake.control.wait_until(lambda truth: truth["moving"])
    fake.control.do("alarm", code=0x51)
    fault = doing.outcome()
    assert isinstance(fault, DeviceFault)
    assert fault.fault_code == "51h"
    assert "joint 2 has lost steps" in str(fault)
    (alarm,) = arm.alarms()
    assert (alarm.code, arm.health) == ("51h", Health.CHECK_FUNCTION)
    assert "home it" in alarm.remedy
    assert arm.state().not_ready_because == ["alarm 51h: joint 2 has lost steps"]
    with pytest.raises(Refused, match="cannot move: alarm 51h"):
        arm.move(at(0.2, 0.0, 0.0))
    with pytest.raises(NotFound):
        arm.acknowledge("10h")
    fake.control.do("alarm", code=0x40)
    fake_sees = fake.control.wait_until(lambda truth: len(truth["alarms"]) == 2)
    assert fake_sees["queued"] == 0
    wait_for(lambda: len(arm.alarms()) == 2)
    with pytest.raises(Refused, match="also active: 40h"):
        arm.acknowledge("51h")
    arm.acknowledge_all()
    written = [frame for frame in fake.truth()["received"] if frame[1] & 1 and frame[0] in range(20, 30)]
    assert written == [[20, 1]], "the vendor's frame, not id 21"
    wait_for(lambda: not arm.alarms())
    arm.move_to_joints(joints(0, 45, 45, 0), 1.0)
    assert fake.truth()["motions"] == 2


def test_an_invalid_setting_names_the_parameter() -> None:
    for settings, words in (
        ({"port": " "}, "^port must be"),
        ({"port": "/dev/ttyUSB0", "answer_timeout": math.nan}, "^answer_timeout must be 0.05 to 5, not nan$"),
        ({"port": "/dev/ttyUSB0", "max_tcp_speed": 0.0}, "^max_tcp_speed"),
        ({"port": "/dev/ttyUSB0", "conveyor_port": 2}, "^conveyor_port must be -1 to 1, not 2$"),
        ({"port": "/dev/ttyUSB0", "home_timeout": 1e9}, "^home_timeout"),
    ):
        with pytest.raises(OutOfRange, match=words):
            DobotMagicianSettings(**settings)  # type: ignore[arg-type]


def test_the_arm_continues_after_a_connection_loss_as_declared() -> None:
    assert DobotMagician.loss_reaction.kind is LossKind.CONTINUES
