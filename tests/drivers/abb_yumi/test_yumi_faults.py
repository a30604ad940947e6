"""Faults of a YuMi: cut cables, stops of the controller, collisions, mode changes, lines that hang."""

import time

import pytest

from arcor2_drivers.abb_yumi.observer import MAX_SAMPLE_AGE
from arcor2_drivers.abb_yumi.yumi import YuMi
from arcor2_hw.data.device import Connection
from arcor2_hw.data.robot import Joint, MoveEnd, Safety
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    InvalidData,
    NotInControl,
    Refused,
    SafetyStop,
    Stale,
)
from tests.drivers.stall import BUSY, stall
from tests.waiting import wait_for

from .conftest import BackgroundCall, FakeYumi, make, under_way
from .test_yumi_motion import turned


def far(robot: YuMi, arm: str = "left") -> list[Joint]:
    joints = robot.robot_joints(arm_id=arm)
    joints[5].value += 2.5 if joints[5].value < 0.5 else -2.5
    return joints


def moving_far(fake: FakeYumi, robot: YuMi, arm: str = "left") -> BackgroundCall:
    doing = BackgroundCall(robot.move_to_joints, far(robot, arm), 0.5, arm_id=arm)
    under_way(fake, arm)
    return doing


def stands_still(fake: FakeYumi, seconds: float = 0.5) -> None:
    before = fake.truth()["arms"]
    time.sleep(seconds)
    after = fake.truth()["arms"]
    assert {arm: each["joints"] for arm, each in before.items()} == {arm: each["joints"] for arm, each in after.items()}


def test_a_stall_of_half_a_second_does_not_stop_the_arms(fake: FakeYumi, ready: YuMi) -> None:
    left, right = moving_far(fake, ready), moving_far(fake, ready, "right")
    stall(BUSY)
    assert all(arm["moving"] for arm in fake.truth()["arms"].values())
    time.sleep(0.2)
    ready.stop()
    for doing in (left, right):
        with pytest.raises(Cancelled):
            doing.result()
    assert ready.control_owner() == "us"


def test_a_frozen_host_stops_the_arms(fake: FakeYumi, ready: YuMi) -> None:
    doing = moving_far(fake, ready)
    stall(YuMi.loss_reaction.within)
    assert not any(arm["moving"] for arm in fake.truth()["arms"].values())
    with pytest.raises(DeviceError):
        doing.result()


def test_the_watchdog_stops_the_arms(fake: FakeYumi, ready: YuMi) -> None:
    left, right = moving_far(fake, ready), moving_far(fake, ready, "right")
    began = time.monotonic()
    fake.do("silence")
    fake.control.wait_until(lambda t: not any(arm["moving"] for arm in t["arms"].values()), 1.0 + BUSY)
    assert time.monotonic() - began > 0.2  # because of the watchdog, not because a socket was closed
    for doing in (left, right):
        with pytest.raises(ConnectionLost) as error:
            doing.result()
        assert "yumi" in str(error.value)
        assert fake.host in f"{error.value} {error.value.detail}"
    wait_for(lambda: ready.connection is Connection.LOST)
    fake.do("heal")
    wait_for(lambda: ready.connection in (Connection.BACK, Connection.ONLINE))
    stands_still(fake)
    assert ready.control_owner() != "us"
    with pytest.raises(NotInControl):
        ready.move_to_joints(far(ready), 0.5, arm_id="left")
    ready.take_control()
    ready.move_to_joints(turned(ready, "left", 1, 0.1), 0.8, arm_id="left")


@pytest.mark.parametrize("wire", ["left", "left_watch"])
def test_a_cut_line_stops_its_arm(fake: FakeYumi, ready: YuMi, wire: str) -> None:
    doing, other = moving_far(fake, ready), moving_far(fake, ready, "right")
    fake.do("reset", wire=wire)
    for each in (doing, other):
        with pytest.raises(ConnectionLost):
            each.result()
    fake.control.wait_until(lambda t: not any(arm["moving"] for arm in t["arms"].values()), 1.0 + BUSY)
    assert ready.connection is Connection.ONLINE
    assert ready.control_owner() is None
    ready.take_control()
    ready.move_to_joints(turned(ready, "left", 1, 0.1), 0.8, arm_id="left")


def test_rapid_is_stopped_when_the_watch_line_hangs(fake: FakeYumi, ready: YuMi) -> None:
    doing = moving_far(fake, ready)
    fake.do("slow", wire="left_watch", seconds=30.0)
    ready.stop("left")
    with pytest.raises(Cancelled):  # the stop was requested before its line was lost
        doing.result()
    fake.control.wait_until(lambda t: not t["arms"]["left"]["moving"], 1.0 + BUSY)
    fake.do("heal")
    stands_still(fake)
    ready.take_control()
    ready.move_to_joints(turned(ready, "left", 1, 0.1), 0.8, arm_id="left")


def test_garbage_on_a_line_is_a_typed_error(fake: FakeYumi, ready: YuMi) -> None:
    fake.do("garbage", wire="left")
    with pytest.raises(DeviceError) as error:
        ready.move_to_joints(far(ready), 0.5, arm_id="left")
    assert isinstance(error.value, (DeviceFault, ConnectionLost, DeviceTimeout, NotInControl))
    assert not fake.moving()


@pytest.mark.parametrize("fault", ["garbage", "half_frame", "reset", "refuse"])
def test_an_rws_failure_is_a_loss_and_recovers(fake: FakeYumi, robot: YuMi, fault: str) -> None:
    fake.do(fault, wire="rws")
    if fault == "refuse":
        fake.do("reset", wire="rws")
    if fault != "reset":
        wait_for(lambda: robot.connection is Connection.LOST)
        with pytest.raises((ConnectionLost, Stale)):
            wait_for(lambda: not robot.robot_joints())
    fake.do("heal")
    wait_for(lambda: robot.connection in (Connection.BACK, Connection.ONLINE))
    wait_for(lambda: len(robot.robot_joints()) == 14)


def test_connecting_to_a_slow_controller_respects_the_timeout(fake: FakeYumi) -> None:
    fake.do("slow", wire="rws", seconds=0.3)
    robot = make(fake.host)
    with pytest.raises(DeviceTimeout) as error:
        robot.connect(1.0)
    assert fake.host in str(error.value)
    fake.do("heal")
    robot.connect(30.0)
    robot.disconnect()


def test_disconnecting_from_a_slow_controller_releases_mastership(fake: FakeYumi, ready: YuMi) -> None:
    fake.do("slow", wire="rws", seconds=0.12)
    time.sleep(0.5)
    ready.disconnect()
    assert fake.truth()["mastership"]["rapid"] is None


def test_a_stale_state_is_an_error_that_names_the_address(fake: FakeYumi, robot: YuMi) -> None:
    robot.get_end_effector_pose("tcp", "left")
    robot._observer.fresh_for = MAX_SAMPLE_AGE
    fake.do("silence", wire="rws")
    time.sleep(MAX_SAMPLE_AGE + 0.1)
    for call in (
        lambda: robot.get_end_effector_pose("tcp", "left"),
        lambda: robot.robot_joints(arm_id="right"),
        robot.state,
    ):
        with pytest.raises((Stale, ConnectionLost)) as error:
            call()
        assert "yumi" in str(error.value)
        assert fake.host in str(error.value)


STOPS = [
    ("emergencystop", Safety.EMERGENCY_STOP),
    ("guardstop", Safety.SAFEGUARD_STOP),
    ("sysfail", Safety.FAULT),
]


@pytest.mark.parametrize(("state", "kind"), STOPS)
def test_a_safety_stop_is_reported_by_its_kind(fake: FakeYumi, ready: YuMi, state: str, kind: Safety) -> None:
    doing = moving_far(fake, ready)
    fake.do("control_state", state=state)
    with pytest.raises(SafetyStop) as error:
        doing.result()
    assert error.value.kind == kind.value
    assert "yumi" in str(error.value)
    assert fake.host in str(error.value)
    assert ready.last_moves["left"].end is MoveEnd.SAFETY
    assert ready.state().safety is kind
    assert [alarm.code for alarm in ready.alarms()] == [kind.value]
    with pytest.raises(Refused):
        ready.acknowledge(kind.value)


def test_after_an_emergency_stop_nothing_moves_until_a_new_command(fake: FakeYumi, ready: YuMi) -> None:
    doing = moving_far(fake, ready)
    fake.do("control_state", state="emergencystop")
    with pytest.raises(SafetyStop):
        doing.result()
    fake.do("control_state", state="emergencystopreset")
    with pytest.raises(SafetyStop):
        ready.take_control()
    fake.do("control_state", state="motoroff")
    wait_for(lambda: ready.state().safety is Safety.NORMAL)
    stands_still(fake)
    begun = fake.arm("left")["moves_begun"]
    ready.take_control()
    stands_still(fake)
    assert fake.arm("left")["moves_begun"] == begun
    ready.move_to_joints(turned(ready, "left", 1, 0.1), 0.8, arm_id="left")


def test_motors_switched_off_during_a_move(fake: FakeYumi, ready: YuMi) -> None:
    doing = moving_far(fake, ready)
    fake.do("control_state", state="motoroff")
    with pytest.raises(NotInControl) as error:
        doing.result()
    assert "motors" in str(error.value)
    assert not fake.moving()


def test_turning_the_key_ends_control(fake: FakeYumi, ready: YuMi) -> None:
    doing = moving_far(fake, ready)
    fake.do("operation_mode", mode="MANR")
    with pytest.raises((SafetyStop, NotInControl)):
        doing.result()
    wait_for(lambda: ready.control_owner() == "pendant")
    with pytest.raises(DeviceError):
        ready.move_to_joints(far(ready), 0.1, arm_id="left")
    with pytest.raises((NotInControl, SafetyStop)):
        ready.take_control()
    assert not fake.moving()


def test_a_rapid_error_is_reported_with_the_controllers_text(fake: FakeYumi, ready: YuMi) -> None:
    doing = moving_far(fake, ready)
    fake.do("rapid_error", code=40512, title="Missing external axis value")
    with pytest.raises(DeviceFault) as error:
        doing.result()
    assert error.value.fault_code == "40512"
    assert "Missing external axis value" in str(error.value)
    wait_for(lambda: fake.truth()["mastership"]["rapid"] is None)


def test_the_interrupted_motion_of_a_stopped_program_is_dropped(fake: FakeYumi, ready: YuMi) -> None:
    doing = moving_far(fake, ready)
    fake.do("rapid_error", code=10125, title="Program stopped")
    with pytest.raises(DeviceFault):
        doing.result()
    fake.control.wait_until(lambda t: not t["arms"]["left"]["moving"])
    before = fake.truth()["writes"].get("resetpp", 0)
    ready.take_control()
    assert fake.truth()["writes"]["resetpp"] == before + 1
    stands_still(fake)


def test_a_collision_is_acknowledged_by_a_person(fake: FakeYumi, ready: YuMi) -> None:
    doing, other = moving_far(fake, ready), moving_far(fake, ready, "right")
    fake.do("collide", arm="left")
    for each in (doing, other):
        with pytest.raises(SafetyStop) as error:
            each.result()
        assert error.value.kind == "protective_stop"
        assert "50204" in error.value.detail
    with pytest.raises(SafetyStop):
        ready.take_control()
    with pytest.raises(Refused):
        ready.acknowledge("protective_stop")
    with pytest.raises(InvalidData):
        ready.acknowledge_protective_stop(" ")
    ready.acknowledge_protective_stop("Eva")
    stands_still(fake)
    with pytest.raises(Refused):
        ready.acknowledge_protective_stop("Eva")
    ready.take_control()
    ready.move_to_joints(turned(ready, "left", 1, 0.1), 0.8, arm_id="left")
    fake.do("collide", arm="right")
    # The earlier acknowledgement does not apply to the new stop.
    wait_for(lambda: ready.state().safety is Safety.PROTECTIVE_STOP)


def test_a_silent_motion_server_is_named(fake: FakeYumi, robot: YuMi) -> None:
    fake.do("silence", wire="right")
    with pytest.raises(DeviceTimeout) as error:
        robot.take_control()
    assert "right arm of yumi" in str(error.value)
    assert f"{fake.host}:6111" in str(error.value)
    assert fake.truth()["mastership"]["rapid"] is None
    assert robot.control_owner() != "us"


def test_a_missing_motion_server_is_named(fake: FakeYumi, robot: YuMi) -> None:
    fake.do("refuse", wire="left")
    with pytest.raises(DeviceError) as error:
        robot.take_control()
    assert f"{fake.host}:6101" in str(error.value)
    assert fake.truth()["mastership"]["rapid"] is None


def test_swapped_ports_of_the_arms_are_detected(fake: FakeYumi) -> None:
    robot = make(fake.host, left_port=6111, right_port=6101)
    robot.connect(30.0)
    with pytest.raises(Refused) as error:
        robot.take_control()
    assert "other arm" in str(error.value)
    robot.disconnect()


def test_a_power_cycle_of_the_controller(fake: FakeYumi, ready: YuMi) -> None:
    doing = moving_far(fake, ready)
    fake.do("power_cycle")
    with pytest.raises(DeviceError) as error:
        doing.result()
    assert isinstance(error.value, (ConnectionLost, NotInControl, DeviceFault))
    wait_for(lambda: ready.connection in (Connection.BACK, Connection.ONLINE))
    stands_still(fake)
    assert ready.control_owner() != "us"
    ready.take_control()
    ready.move_to_joints(turned(ready, "left", 1, 0.1), 0.8, arm_id="left")
