"""Observing a YuMi, taking control of it, and reasons that prevent control."""

import time
from typing import Any

import httpx
import pytest

from arcor2_drivers.abb_yumi.rws import Rws
from arcor2_drivers.abb_yumi.yumi import YuMi
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Control, Mode, Power, ProgramState, Safety
from arcor2_hw.exceptions import DeviceError, InvalidData, NotConnected, NotFound, NotInControl, Refused, SafetyStop
from tests.waiting import wait_for

from .conftest import RWS_PORT, BackgroundCall, FakeYumi, make

HOME = Position(-0.0096, 0.1826, 0.1986)
"""Position of the left flange in the calibration position according to RobotStudio, m (from general knowledge)."""


def test_connecting_only_observes(fake: FakeYumi) -> None:
    fake.do("control_state", state="motoroff")
    before = fake.truth()
    robot = make(fake.host)
    robot.connect(30.0)
    robot.connect(30.0)
    assert robot.state().power is Power.OFF
    assert robot.robot_joints()
    assert robot.control_owner() is None
    robot.disconnect()
    after = fake.truth()
    assert after["writes"] == before["writes"]
    assert after["control_state"] == "motoroff"
    assert not after["running"]
    assert after["mastership"] == dict.fromkeys(("cfg", "motion", "rapid"))
    assert robot.connection is Connection.OFFLINE


def test_joints_and_poses_of_both_arms_differ(robot: YuMi) -> None:
    assert robot.get_arm_ids() == {"left", "right"}
    both, left, right = robot.robot_joints(), robot.robot_joints(arm_id="left"), robot.robot_joints(arm_id="right")
    assert [joint.name for joint in left] == [f"ROB_L_{number}" for number in range(1, 8)]
    assert both == left + right
    assert left[6].value == pytest.approx(-right[6].value) == pytest.approx(2.35619, abs=1e-4)
    assert set(robot.joint_limits("right")) == {joint.name for joint in right}
    with pytest.raises(NotFound):
        robot.robot_joints(arm_id="middle")
    with pytest.raises(InvalidData):
        robot.get_end_effector_pose("tcp")
    with pytest.raises(NotFound):
        robot.get_end_effector_pose("hand", "left")
    assert robot.grippers("left") == {"gripper"}
    assert robot.suctions() == set()


def test_poses_are_those_of_the_tool_in_the_world(fake: FakeYumi) -> None:
    at = Pose(Position(1.0, 2.0, 0.5), Orientation.from_rotation_vector(0.0, 0.0, 1.5707963267948966))
    bare, tooled = make(fake.host, at, left_tcp_z=0.0), make(fake.host)
    for each in (bare, tooled):
        each.connect(30.0)
    flange = at.inverted() * bare.get_end_effector_pose("tcp", "left")
    assert flange.position.distance_to(HOME) < 0.002
    assert bare.get_end_effector_pose("tcp", "left").position.distance_to(Position(0.817, 1.99, 0.699)) < 0.002
    tcp = tooled.get_end_effector_pose("tcp", "left")
    assert (flange.inverted() * tcp).position.distance_to(Position(0.0, 0.0, 0.136)) < 1e-5
    for each in (bare, tooled):
        each.disconnect()


def test_the_state_is_complete(robot: YuMi) -> None:
    robot.take_control()
    wait_for(lambda: robot.state().program is ProgramState.PLAYING)
    state = robot.state()
    assert (state.mode, state.power, state.safety) == (Mode.AUTOMATIC, Power.OPERATIONAL, Safety.NORMAL)
    assert (state.control, state.moving, state.speed_override) == (Control.REMOTE, False, 1.0)
    assert state.not_ready_because == []
    assert robot.health is Health.NORMAL
    identity = robot.identify()
    assert (identity.vendor, identity.serial, identity.firmware) == ("ABB", "14000-500000", "RobotWare 6.13.0190")


def test_control_is_taken_and_released(fake: FakeYumi, robot: YuMi) -> None:
    fake.do("control_state", state="motoroff")
    robot.take_control()
    robot.take_control()
    truth = fake.truth()
    assert truth["control_state"] == "motoron"
    assert truth["running"]
    assert truth["mastership"]["rapid"] == "Default User"
    assert truth["arms"]["left"]["load"] == [0.23, 0.0, 0.0, 50.0]
    assert truth["arms"]["right"]["tool_position"] == pytest.approx([0.0, 0.0, 0.136])
    assert robot.control_owner() == "us"
    robot.release_control()
    robot.release_control()
    truth = fake.truth()
    assert truth["mastership"]["rapid"] is None
    assert truth["control_state"] == "motoron"
    assert robot.control_owner() is None
    robot.take_control()
    assert robot.control_owner() == "us"


FORBIDDING: list[tuple[str, dict[str, Any], type[DeviceError], str]] = [
    ("operation_mode", {"mode": "MANR"}, NotInControl, "MANR"),
    ("operation_mode", {"mode": "MANF"}, NotInControl, "MANF"),
    ("control_state", {"state": "emergencystop"}, SafetyStop, "emergency stop"),
    ("control_state", {"state": "emergencystopreset"}, SafetyStop, "emergency stop"),
    ("control_state", {"state": "guardstop"}, SafetyStop, "safeguard stop"),
    ("control_state", {"state": "sysfail"}, SafetyStop, "fault"),
    ("foreign_program", {"on": True, "name": "Palletizing"}, NotInControl, "Palletizing"),
]


@pytest.mark.parametrize(("fault", "arguments", "kind", "named"), FORBIDDING)
def test_reasons_against_control_are_named(
    fake: FakeYumi, robot: YuMi, fault: str, arguments: dict[str, Any], kind: type[DeviceError], named: str
) -> None:
    if fault == "operation_mode":
        fake.do("control_state", state="motoroff")
    fake.do(fault, **arguments)
    before = fake.truth()["writes"]
    with pytest.raises(kind) as error:
        robot.take_control()
    assert named in str(error.value)
    assert "yumi" in str(error.value)
    assert fake.truth()["writes"] == before
    assert robot.control_owner() != "us"
    if fault == "operation_mode":
        wait_for(lambda: robot.control_owner() == "pendant")
        assert robot.state().control is Control.LOCAL
        with pytest.raises(NotInControl):
            robot.power_on()
    elif fault == "control_state":
        wait_for(lambda: [alarm.text for alarm in robot.alarms()] == [named])
        assert robot.alarms()[0].remedy
        assert robot.state().not_ready_because == [named]
        assert robot.health in (Health.CHECK_FUNCTION, Health.FAILURE)
    else:
        wait_for(lambda: robot.state().program is ProgramState.FOREIGN)
        assert robot.control_owner() == "Palletizing"


def test_the_holder_of_mastership_is_named(fake: FakeYumi, robot: YuMi) -> None:
    fake.do("mastership_held", alias="Anna", location="Cell 3")
    before = fake.truth()["writes"]
    with pytest.raises(NotInControl) as error:
        robot.take_control()
    assert "Anna (RobotStudio, Cell 3)" in str(error.value)
    assert "-1073445846" in error.value.detail  # the controller's own number
    assert fake.truth()["writes"] == before
    wait_for(lambda: robot.control_owner() == "Anna (RobotStudio, Cell 3)")


def test_mastership_of_the_first_hub_refuses_a_second_one(fake: FakeYumi, robot: YuMi) -> None:
    robot.take_control()
    other = make(fake.host)
    other.connect(30.0)
    with pytest.raises(NotInControl) as error:
        other.take_control()
    assert "Default User" in str(error.value)
    assert other.control_owner() == "Default User (RWS, remote client)"
    other.disconnect()
    assert robot.control_owner() == "us"


def test_a_foreign_program_that_is_stopped_is_named(fake: FakeYumi, robot: YuMi) -> None:
    fake.do("foreign_program", on=True, name="Welding")
    fake.do("rapid_error", code=10125, title="Program stopped")
    with pytest.raises(Refused) as error:
        robot.take_control()
    assert "Welding" in str(error.value)
    assert "Arcor2Left.pgf" in str(error.value)
    assert fake.truth()["mastership"]["rapid"] is None


def test_control_is_refused_without_a_mass(fake: FakeYumi) -> None:
    robot = make(fake.host, right_mass=-1.0)
    robot.connect(30.0)
    with pytest.raises(Refused) as error:
        robot.take_control()
    assert "right_mass" in str(error.value)
    robot.disconnect()


def test_a_wrong_password_is_reported(fake: FakeYumi) -> None:
    robot = make(fake.host, password="guess")
    with pytest.raises(NotConnected) as error:
        robot.connect(2.0)
    assert "Default User" in str(error.value)
    assert fake.host in str(error.value)
    assert "guess" not in str(error.value)
    robot.disconnect()


def test_power_on_only_switches_the_motors_on(fake: FakeYumi, robot: YuMi) -> None:
    fake.do("control_state", state="motoroff")
    robot.power_on()
    truth = fake.truth()
    assert truth["control_state"] == "motoron"
    assert not truth["running"]
    assert truth["mastership"]["rapid"] is None


def test_sessions_do_not_accumulate(fake: FakeYumi) -> None:
    """A controller allows 70 sessions. Observing needs one, control another one."""
    before = fake.truth()["sessions"]
    robot = make(fake.host)
    robot.connect(30.0)
    robot.power_on()
    assert fake.truth()["sessions"] == before + 2
    robot.disconnect()
    assert fake.truth()["sessions"] == before


def test_a_session_can_be_closed_during_a_request(fake: FakeYumi) -> None:
    """The request ends normally. The next request opens a new connection of the same session."""
    rws = Rws("yumi", fake.host, RWS_PORT, "Default User", "robotics")
    rws.get("/rw/system")
    sessions = fake.truth()["sessions"]
    fake.do("slow", wire="rws", seconds=0.2)
    requests = fake.truth()["requests"]
    doing = BackgroundCall(rws.value, "/rw/panel/opmode", "opmode", 10.0)
    fake.control.wait_until(lambda t: t["requests"] > requests)
    rws.close()
    assert doing.result() == "AUTO"
    fake.do("heal")
    assert rws.value("/rw/panel/opmode", "opmode") == "AUTO"
    assert fake.truth()["sessions"] == sessions
    rws.logout()


def test_a_refusal_contains_the_controllers_text(fake: FakeYumi) -> None:
    rws = Rws("yumi", fake.host, RWS_PORT, "Default User", "robotics")
    with pytest.raises(Refused) as error:
        rws.act("/rw/rapid/execution", "resetpp")
    assert "mastership" in str(error.value)
    assert "HTTP 403, code -1073445859" in error.value.detail
    with pytest.raises(Refused) as error:
        rws.get("/rw/nothing")
    assert "HTTP 404" in error.value.detail
    rws.logout()


def test_json_and_xhtml_answers_have_the_same_content(fake: FakeYumi) -> None:
    with httpx.Client(
        base_url=f"http://{fake.host}:{RWS_PORT}", auth=httpx.DigestAuth("Default User", "robotics"), trust_env=False
    ) as client:
        assert client.get("/rw/panel/opmode", auth=None).status_code == 401
        as_page = client.get("/rw/panel/opmode")
        assert '<span class="opmode">AUTO</span>' in as_page.text
        as_json = client.get("/rw/panel/opmode", params={"json": "1"}).json()
        assert as_json["_embedded"]["_state"] == [{"_type": "pnl-opmode", "_title": "opmode", "opmode": "AUTO"}]
        client.get("/logout")


def test_observing_sends_a_limited_number_of_requests(fake: FakeYumi, robot: YuMi) -> None:
    before, began = fake.truth()["requests"], time.monotonic()
    requests = fake.control.wait_until(lambda t: t["requests"] >= before + 20)["requests"] - before
    assert requests / (time.monotonic() - began) < 90.0
