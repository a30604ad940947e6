"""The vacuum gripper on the outputs of a robot, also while the robot moves."""

import threading
import time
from collections.abc import Iterator

import pytest

from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_drivers.vacuum_gripper.settings import VacuumGripperSettings
from arcor2_drivers.vacuum_gripper.suction_gripper import SuctionGripper
from arcor2_hw.exceptions import NotFound, NotInControl
from tests.drivers.universal_robots.conftest import BackgroundCall, FakeUr, make, moving
from tests.waiting import wait_for


@pytest.fixture(scope="module")
def ur() -> Iterator[FakeUr]:
    fake = FakeUr("--time-scale", "0.1")
    yield fake
    fake.end()


@pytest.fixture
def robot(ur: FakeUr) -> Iterator[UR5e]:
    ur.reset()
    robot = make(ur.host)
    robot.connect(30.0)
    yield robot
    ur.do("set_input", bit=16, on=False)
    robot.disconnect()


@pytest.fixture
def gripper(robot: UR5e) -> Iterator[SuctionGripper]:
    settings = VacuumGripperSettings("ur", "tool_out[0]", blow_output="config_out[1]", part_input="tool_in[0]")
    made = SuctionGripper("gripper_id", "gripper", settings)
    made.attach(lambda _: robot)
    made.connect()
    yield made
    made.disconnect()


def test_robot_and_gripper_take_control_at_once(robot: UR5e, gripper: SuctionGripper, ur: FakeUr) -> None:
    with pytest.raises(NotInControl, match="gripper on ur"):
        gripper.on()
    taken = ur.truth()["scripts_taken"]
    threads = [threading.Thread(target=each.take_control) for each in (robot, gripper)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert gripper.control_owner() == robot.control_owner() == "us"
    assert ur.truth()["scripts_taken"] == taken + 1


def test_gripping_during_a_move_keeps_the_part_at_a_stop(robot: UR5e, gripper: SuctionGripper, ur: FakeUr) -> None:
    gripper.take_control()
    joints = robot.robot_joints()
    joints[0].value += 2.0
    going = BackgroundCall(robot.move_to_joints, joints, 0.2)
    moving(ur)
    gripping = BackgroundCall(gripper.grip)
    ur.control.wait_until(lambda t: t["digital_outputs"] >> 16 & 1)
    ur.do("set_input", bit=16, on=True)
    gripping.result()
    assert ur.truth()["moving"], "robot and gripper work at the same time"
    robot.stop()
    gripper.stop()
    with pytest.raises(Exception, match="stopped"):
        going.result()
    assert ur.truth()["digital_outputs"] >> 16 & 1
    ur.do("set_input", bit=16, on=False)
    wait_for(lambda: bool(gripper.alarms()))
    gripper.off()
    assert not ur.truth()["digital_outputs"] >> 16 & 1
    began = time.monotonic()
    gripper.blow_off()
    assert time.monotonic() - began >= 0.2


def test_the_carrier_holds_the_part(robot: UR5e, gripper: SuctionGripper, ur: FakeUr) -> None:
    gripper.mount(lambda _: robot, lambda name: _no_robot())
    gripper.take_control()
    gripper.set_part(0.1, 0.1, 0.02)
    ur.do("set_input", bit=16, on=True)
    gripper.grip()
    assert list(robot.parts) == ["part of gripper"]
    gripper.off()
    assert robot.parts == {}


def _no_robot() -> UR5e:
    raise NotFound("the scene has 2 robots")


def test_gripping_during_a_motion_program(robot: UR5e, gripper: SuctionGripper, ur: FakeUr) -> None:
    robot.take_control()
    here = robot.get_end_effector_pose("tcp")
    there = type(here)(here.position - type(here.position)(0.0, 0.2, 0.0), here.orientation)
    going = BackgroundCall(robot.move_path, [there], 0.0, True, 0.1)
    moving(ur)
    gripper.on()
    assert ur.truth()["moving"]
    assert gripper.is_part_held() is False
    going.result()
    gripper.off()
