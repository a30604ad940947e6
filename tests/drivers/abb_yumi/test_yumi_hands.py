"""Hands of a YuMi, and hand teaching."""

import pytest

from arcor2_drivers.abb_yumi.yumi import ArmId, YuMi
from arcor2_hw.exceptions import Cancelled, DeviceFault, Refused
from tests.waiting import wait_for

from .conftest import BackgroundCall, FakeYumi, make, under_way
from .test_yumi_motion import turned


def test_fingers_grip_a_part(fake: FakeYumi, ready: YuMi) -> None:
    ready.calibrate_gripper(ArmId.RIGHT)
    assert ready.open_gripper(ArmId.RIGHT, 0.02) == pytest.approx(0.02, abs=1e-5)
    fake.do("part", arm="right")
    assert ready.grip(ArmId.RIGHT, 8.0) == pytest.approx(0.01, abs=1e-5)
    assert ready.gripper_width(ArmId.RIGHT) == pytest.approx(0.01, abs=1e-5)
    assert fake.arm("right")["width"] == pytest.approx(0.01)
    assert fake.arm("left")["width"] == pytest.approx(0.025)


def test_gripping_nothing_is_an_error(fake: FakeYumi, ready: YuMi) -> None:
    ready.calibrate_gripper()
    with pytest.raises(DeviceFault) as error:
        ready.grip()
    assert error.value.fault_code == "nothing_held"
    assert "left hand of yumi" in str(error.value)


def test_uncalibrated_fingers_are_refused(ready: YuMi) -> None:
    with pytest.raises(Refused) as error:
        ready.grip()
    assert "refused" in str(error.value)
    assert ready.control_owner() == "us"


def test_a_stop_opens_no_gripper(fake: FakeYumi, ready: YuMi) -> None:
    ready.calibrate_gripper()
    ready.open_gripper()
    fake.do("part", arm="left")
    ready.grip()
    moving = BackgroundCall(ready.move_to_joints, turned(ready, "left", 6, 1.0), 0.5, arm_id="left")
    under_way(fake, "left")
    ready.stop()
    with pytest.raises(Cancelled):
        moving.result()
    assert fake.arm("left")["width"] == pytest.approx(0.01)
    ready.disconnect()
    assert fake.arm("left")["width"] == pytest.approx(0.01)


def test_a_suction_cup_that_is_not_configured_is_refused(fake: FakeYumi, ready: YuMi) -> None:
    with pytest.raises(Refused) as error:
        ready.set_suction(ArmId.LEFT, True)
    assert "left_suction" in str(error.value)
    ready.disconnect()
    robot = make(fake.host, left_suction=True, left_gripper=False)
    robot.connect(30.0)
    robot.take_control()
    robot.set_suction(ArmId.LEFT, True)
    assert fake.arm("left")["vacuum"]
    with pytest.raises(Refused):
        robot.grip(ArmId.LEFT)
    assert (robot.suctions("left"), robot.suctions("right"), robot.grippers("left")) == ({"suction"}, set(), set())
    robot.disconnect()
    assert fake.arm("left")["vacuum"]


def test_one_arm_is_taught_by_hand(fake: FakeYumi, ready: YuMi) -> None:
    assert not ready.get_hand_teaching_mode("left")
    ready.set_hand_teaching_mode(True, "left")
    assert ready.get_hand_teaching_mode("left")
    assert not ready.get_hand_teaching_mode("right")
    assert fake.arm("left")["lead_through"]
    assert fake.truth()["mastership"]["motion"] is None
    fake.do("place", arm="left", joints=[0.0, -120.0, 20.0, 10.0, 40.0, 0.0, 130.0])
    wait_for(lambda: abs(ready.robot_joints(arm_id="left")[3].value - 0.1745) < 1e-3)
    for arm in ("left", "right"):
        with pytest.raises(Refused) as error:
            ready.move_to_joints(turned(ready, arm, 6, 0.2), 0.5, arm_id=arm)
        assert "left arm of yumi is in hand teaching mode" in str(error.value)
    ready.set_hand_teaching_mode(False, "left")
    ready.move_to_joints(turned(ready, "left", 6, 0.1), 0.8, arm_id="left")


def test_hand_teaching_is_refused_while_an_arm_moves(fake: FakeYumi, ready: YuMi) -> None:
    moving = BackgroundCall(ready.move_to_joints, turned(ready, "left", 6, 1.0), 0.5, arm_id="left")
    under_way(fake, "left")
    with pytest.raises(Refused):
        ready.set_hand_teaching_mode(True, "right")
    assert not fake.arm("right")["lead_through"]
    ready.stop()
    with pytest.raises(Cancelled):
        moving.result()


def test_releasing_control_makes_the_arm_stiff(fake: FakeYumi, ready: YuMi) -> None:
    ready.set_hand_teaching_mode(True, "right")
    ready.release_control()
    assert not fake.arm("right")["lead_through"]
