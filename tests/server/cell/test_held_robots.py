"""Hold-to-run motion as clients see it: one holder, its lock, late requests, events; acknowledging a stop."""

import asyncio
import json
import math
import time
from typing import Any

import msgspec
import pytest

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.project import Action, ActionPoint, Flow, Project
from arcor2_hw.data.role import Role
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message
from arcor2_server.errors import RequestRefused
from arcor2_server.online import hold_to_run
from arcor2_server.rpc import operation as _operation  # noqa: F401 - for its handlers
from tests.server.core.serving import until

from .conftest import Recorder, Server, action, robot_meta, serving

ARM = """
from arcor2_hw.data.robot import *

class Arm(Robot):
    _ABSTRACT = False

    def __init__(self, obj_id, name, pose, settings=None):
        super().__init__(obj_id, name, pose, settings)
        self.jogs = []
        self.stops = 0
        self.hand = False
        self.hands = []
        self.safety = "normal"
        self.confirmed = []
        self.slow = 0.0

    def get_end_effectors_ids(self): return {"tool"}
    def get_end_effector_pose(self, end_effector): return Pose()
    def robot_joints(self, include_gripper=False): return [Joint("j0", 0.5)]
    def grippers(self): return set()
    def suctions(self): return set()
    def get_hand_teaching_mode(self): return self.hand
    def set_hand_teaching_mode(self, enabled):
        self.hand = enabled
        self.hands.append(enabled)
    def stop(self):
        time.sleep(self.slow)
        self.stops += 1
    def jog(self, twist=None, joint_velocities=None, frame="world", valid_for=0.2, end_effector_id=None):
        if self.safety != "normal": raise SafetyStop("protective stop of arm")
        self.jogs.append([twist, joint_velocities, frame])
    def move_to_pose(self, end_effector_id, target_pose: Pose, speed, safe=True, linear=True): pass
    def state(self):
        return RobotState(Mode.AUTOMATIC, Power.OPERATIONAL, Safety(self.safety), ProgramState.STOPPED,
                          Control.REMOTE, False, 1.0)
    def acknowledge_protective_stop(self, confirmed_by: str):
        if self.safety != "protective_stop": raise Refused("arm is in no protective stop")
        self.safety = "normal"
        self.confirmed.append(["protective stop", confirmed_by])
    def restart_safety(self, confirmed_by: str):
        self.safety = "normal"
        self.confirmed.append(["restart", confirmed_by])
    def alarms(self): return self.standing if hasattr(self, "standing") else []
    def acknowledge(self, code: str):
        if code != "E7": raise NotFound(f"arm has no alarm {code}")
        self.confirmed.append([code])

    def report(self): return [self.jogs, self.stops, self.hands, self.confirmed]
    def be(self, safety: str): self.safety = safety
    def be_slow(self, slow: float): self.slow = slow
    @action
    def wave(self, *, an: str | None = None) -> None: pass
"""
OBJ, TABLE = "obj_arm", "obj_table"
TURNED = Orientation.from_rotation_vector(0.0, 0.0, math.pi / 2)
META = robot_meta("Arm", move_to_pose=True, stop=True, hand_teaching=True, jog=True, acknowledge_stop=True)
SCENE = Scene(
    "scene",
    id="scn_1",
    objects=[
        SceneObject("arm", "Arm", Pose(), [], OBJ),
        SceneObject("table", "Table", Pose(Position(1, 0, 0), TURNED), [], TABLE),
    ],
)
TABLE_SOURCE = "class Table(GenericWithPose):\n    _ABSTRACT = False\n"
PROJECT = Project(
    "project",
    "scn_1",
    id="pro_1",
    action_points=[
        ActionPoint("top", Position(), id="acp_1", actions=[Action("wave", f"{OBJ}/wave", "act_wave", [], [Flow()])])
    ],
)


LEASE_MS = 20_000
"""Duration of a lease, ms. With the 300 ms of the protocol, a busy computer would end most holds."""


@pytest.fixture(autouse=True)
def long_leases(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hold_to_run, "MAX_LEASE_MS", LEASE_MS)


async def with_arm(server: Server) -> None:
    server.types.add("Arm", ARM, [action("wave")], META)
    server.types.add("Table", TABLE_SOURCE)
    await server.open(SCENE, PROJECT)
    await server.start()
    await server.services.locks.write_lock("alice", OBJ)
    server.client.got.clear()


class HoldButton:
    """A client that presses a jog or hand-teaching button."""

    def __init__(self, server: Server, client: Recorder | None = None) -> None:
        self.server = server
        self.client = client or server.client
        self.number = 0

    async def jog(
        self, valid_ms: int = LEASE_MS, *, new: bool = False, sent_ms: float | None = None, **more: Any
    ) -> Any:
        self.number += new
        if not more and valid_ms:
            more = {"linear": {"x": 0.1}}
        args = {"robot_id": OBJ, "hold": self.number, "valid_ms": valid_ms} | more
        args["sent_ms"] = time.monotonic() * 1e3 if sent_ms is None else sent_ms
        return await self.server.ask("JogRobot", args, self.client)

    async def teach(self, valid_ms: int = LEASE_MS, *, new: bool = False) -> Any:
        self.number += new
        args = {"robot_id": OBJ, "hold": self.number, "valid_ms": valid_ms, "sent_ms": time.monotonic() * 1e3}
        return await self.server.ask("HoldHandTeaching", args, self.client)


async def report(server: Server) -> tuple[Any, ...]:
    return tuple(json.loads(await server.services.online.call(OBJ, "report")))


async def do(server: Server, method: str, **args: Any) -> None:
    await server.services.online.call(OBJ, method, args)


async def join(server: Server, user: str, role: Role = Role.PROGRAMMER) -> Recorder:
    client = Recorder(user)
    client.role = role
    server.services.hub.add(client)  # type: ignore[arg-type]
    subscribe(server, client)
    return client


def subscribe(server: Server, client: Recorder) -> None:
    server.services.hub.subscribe(client, {"RobotHold", "ObjectHealth", "ObjectState"}, True)  # type: ignore[arg-type]


@serving(with_arm)
async def test_a_jog_runs_from_press_to_release(server: Server) -> None:
    subscribe(server, server.client)
    button = HoldButton(server)
    assert (await button.jog(new=True)).scale == 1.0
    assert await server.client.event("RobotHold") == {
        "robot_id": OBJ, "kind": "jog", "user": "alice", "held": True,
    }  # fmt: skip
    step = {"robot_id": OBJ, "end_effector_id": "tool", "axis": "x", "what": "position", "mode": "world", "step": 0.1}
    with pytest.raises(RequestRefused, match="arm is being moved by alice"):
        await server.ask("StepRobotEef", step)
    with pytest.raises(RequestRefused, match="arm is"):
        await server.ask("ExecuteAction", {"action_id": "act_wave"})
    assert (await button.jog(linear={"z": 0.5})).scale == 0.5
    assert (await button.jog(0)).scale == 0.0
    event = await server.client.event("RobotHold")
    assert (event["held"], "reason" in event) == (False, False)
    jogs, stops, *_ = await report(server)
    assert jogs == [[[0.1, 0, 0, 0, 0, 0], None, "world"], [[0, 0, 0.25, 0, 0, 0], None, "world"]]
    assert stops == 1
    with pytest.raises(RequestRefused, match="press it again"):
        await button.jog()
    await button.jog(0)  # a second release has no effect
    await server.ask("ExecuteAction", {"action_id": "act_wave"})


@serving(with_arm)
async def test_only_one_client_can_jog_a_robot(server: Server) -> None:
    alice, bob = HoldButton(server), HoldButton(server, await join(server, "bob"))
    with pytest.raises(RequestRefused, match="arm is locked by alice"):
        await bob.jog(new=True)
    await alice.jog(new=True)
    with pytest.raises(RequestRefused, match="arm is being moved by alice"):
        await bob.jog(new=True)
    with pytest.raises(RequestRefused, match="arm is being moved by alice"):
        await bob.teach(new=True)
    await server.services.locks.write_unlock("alice", OBJ)
    with pytest.raises(RequestRefused, match="Lock arm before"):
        await alice.jog()
    event = await bob.client.event("RobotHold", lambda data: not data["held"])
    assert "alice no longer holds the lock" in event["reason"]
    assert (await report(server))[1] == 1
    await server.services.locks.write_lock("bob", OBJ)
    await bob.jog(new=True)
    await bob.jog(0)


@serving(with_arm)
async def test_motion_that_is_not_renewed_stops_until_the_next_press(server: Server) -> None:
    subscribe(server, server.client)
    button = HoldButton(server)
    await button.jog(1000, new=True)
    event = await server.client.event("RobotHold", lambda data: not data["held"])
    assert "not renewed in time" in event["reason"]
    assert (await report(server))[1] == 1
    with pytest.raises(RequestRefused, match="press it again"):
        await button.jog()
    await button.jog(new=True)
    await button.jog(0)


@serving(with_arm)
async def test_a_closed_connection_stops_the_motion(server: Server) -> None:
    bob = await join(server, "bob")
    button = HoldButton(server)
    await button.jog(new=True)
    server.services.hub.remove(server.client)  # type: ignore[arg-type]
    event = await bob.event("RobotHold", lambda data: not data["held"])
    assert "alice is no longer connected" in event["reason"]
    assert (await report(server))[1] == 1
    assert server.services.online.held.holder(OBJ) is None
    assert server.services.online.moving == set()


@serving(with_arm)
async def test_logging_off_stops_the_motion(server: Server) -> None:
    bob = await join(server, "bob")
    button = HoldButton(server)
    await button.jog(new=True)
    server.services.online.held.logged_off(bob, Message.of("bob logged off"))  # bob holds no robot
    server.services.online.held.logged_off(server.client, Message.of("alice logged off"))
    event = await bob.event("RobotHold", lambda data: not data["held"])
    assert event["reason"] == "alice logged off"
    assert (await report(server))[1] == 1
    with pytest.raises(RequestRefused, match="press it again"):
        await button.jog()


@serving(with_arm)
async def test_hand_teaching_mode_ends_when_its_user_leaves(server: Server) -> None:
    bob = await join(server, "bob")
    held, on = server.services.online.held, {"robot_id": OBJ, "enable": True}

    async def ended() -> str:
        assert not (await bob.event("HandTeachingMode", lambda data: not data["enabled"]))["enabled"]
        return str((await bob.event("Notification"))["message"])

    await server.ask("HandTeachingMode", on)
    held.logged_off(bob, Message.of("bob logged off"))  # type: ignore[arg-type]  # bob does not teach
    held.logged_off(server.client, Message.of("alice logged off"))  # type: ignore[arg-type]
    assert await ended() == "Hand teaching of arm was switched off: alice logged off."
    assert (await report(server))[2] == [True, False]
    bob.got.clear()
    await server.ask("HandTeachingMode", on)
    server.services.hub.remove(server.client)  # type: ignore[arg-type]
    assert await ended() == "Hand teaching of arm was switched off: alice is no longer connected."
    assert (await report(server))[2] == [True, False, True, False]


@serving(with_arm)
async def test_late_requests_are_ignored(server: Server) -> None:
    """The delay is measured although the clocks of client and server differ."""
    button = HoldButton(server)

    def client_clock(late: float = 0.0) -> float:
        return (time.monotonic() - late) * 1e3 + 123_456.0

    await button.jog(new=True, sent_ms=client_clock())
    with pytest.raises(RequestRefused, match="ms late"):
        await button.jog(sent_ms=client_clock(LEASE_MS / 1e3 + 0.1))
    with pytest.raises(RequestRefused, match="ms late"):
        await button.jog(new=True, sent_ms=client_clock(2.0 * LEASE_MS / 1e3))
    button.number -= 1
    await button.jog(sent_ms=client_clock(LEASE_MS / 1e3 - 2.0))  # the lease ends 2 s from now
    await until(lambda: server.services.online.held.holder(OBJ) is None, LEASE_MS / 1e3 / 2.0)
    assert len((await report(server))[0]) == 2


@serving(with_arm)
async def test_queued_requests_of_an_ended_hold_do_not_move_the_robot(server: Server) -> None:
    subscribe(server, server.client)
    button = HoldButton(server)
    await button.jog(1000, new=True)
    await server.client.event("RobotHold", lambda data: not data["held"])
    for outcome in await asyncio.gather(*(button.jog() for _ in range(5)), return_exceptions=True):
        assert isinstance(outcome, RequestRefused)
    assert len((await report(server))[0]) == 1


@serving(with_arm)
async def test_renewals_and_a_new_press_need_not_wait_for_answers(server: Server) -> None:
    button = HoldButton(server)
    burst = [asyncio.create_task(button.jog(new=number == 0)) for number in range(4)]
    assert {answer.scale for answer in await asyncio.gather(*burst)} == {1.0}
    await do(server, "be_slow", slow=0.1)
    releasing = asyncio.create_task(button.jog(0))
    await asyncio.sleep(0)
    assert (await button.jog(new=True)).scale == 1.0  # after the robot has stopped
    assert (await releasing).scale == 0.0
    await button.jog(0)


@serving(with_arm)
async def test_jogging_uses_the_requested_frame_or_joints(server: Server) -> None:
    button = HoldButton(server)
    along_y = pytest.approx([0, 0.1, 0, 0, 0, 0.2], abs=1e-9)
    velocity = {"linear": {"x": 0.1}, "angular": {"z": 0.2}}
    await button.jog(new=True, frame="user", object_id=TABLE, **velocity)
    await button.jog(frame="user", pose=msgspec.to_builtins(Pose(Position(5, 5, 5), TURNED)), **velocity)
    for frame in ("robot", "tool"):
        await button.jog(frame=frame, **velocity)
    await button.jog(joints=[{"name": "j0", "value": 0.3}])
    await button.jog(0)
    jogs = (await report(server))[0]
    assert [jog[2] for jog in jogs] == ["world", "world", "base", "tool", "world"]
    assert jogs[0][0] == along_y
    assert jogs[1][0] == along_y
    assert jogs[2][0] == [0.1, 0, 0, 0, 0, 0.2]
    assert jogs[4][:2] == [None, [0.3]]


INVALID: list[tuple[dict[str, Any], str]] = [
    ({"valid_ms": LEASE_MS + 1}, f"valid_ms must be 0 to {LEASE_MS}"),
    ({"valid_ms": -1}, f"valid_ms must be 0 to {LEASE_MS}"),
    ({"linear": None}, "either joint velocities"),
    ({"joints": [{"name": "j0", "value": 1.0}]}, "either joint velocities"),
    ({"frame": "user"}, "either an object or a pose"),
    ({"frame": "user", "object_id": "obj_nobody"}, "obj_nobody"),
    ({"object_id": TABLE}, "only allowed with the frame user"),
    ({"arm_id": "left"}, "has one arm"),
    ({"robot_id": TABLE}, "table is not a robot"),
    ({"end_effector_id": "claw"}, "no end effector 'claw'"),
    ({"linear": None, "joints": [{"name": "j9", "value": 1.0}]}, "no joint j9"),
    ({"linear": None, "joints": [{"name": "j0", "value": 1.0}] * 2}, "given twice"),
]


@serving(with_arm)
async def test_invalid_arguments_are_refused(server: Server) -> None:
    for number, (more, text) in enumerate(INVALID):
        args = {"robot_id": OBJ, "hold": number, "valid_ms": LEASE_MS, "linear": {"x": 0.1}} | more
        args = {key: value for key, value in args.items() if value is not None}
        with pytest.raises(Arcor2Error, match=text):
            await server.ask("JogRobot", args | {"sent_ms": time.monotonic() * 1e3})
        assert server.services.online.moving == set(), text
    assert (await report(server))[0] == []


@serving(with_arm)
async def test_hand_teaching_lasts_while_the_button_is_held(server: Server) -> None:
    subscribe(server, server.client)
    button = HoldButton(server)
    await button.teach(new=True)
    event = await server.client.event("HandTeachingMode")
    assert event == {"robot_id": OBJ, "enabled": True}
    await button.teach()
    assert server.services.online.held.states()[0].kind == "hand_teaching"
    await button.teach(0)
    assert await server.client.event("HandTeachingMode") == {"robot_id": OBJ, "enabled": False}
    assert (await report(server))[2] == [True, False]
    await button.teach(1000, new=True)
    await server.client.event("HandTeachingMode", lambda data: not data["enabled"])
    assert (await report(server))[2] == [True, False] * 2
    await server.ask("HandTeachingMode", {"robot_id": OBJ, "enable": True})
    with pytest.raises(RequestRefused, match="moved by hand"):
        await button.jog(new=True)
    with pytest.raises(RequestRefused, match="moved by hand"):
        await button.teach(new=True)


@serving(with_arm)
async def test_clients_are_notified_when_a_protective_stop_ends_hand_teaching(server: Server) -> None:
    subscribe(server, server.client)
    button = HoldButton(server)
    await button.teach(new=True)
    await server.client.event("HandTeachingMode", lambda data: data["enabled"])
    await do(server, "be", safety="protective_stop")
    event = await server.client.event("RobotHold", lambda data: not data["held"])
    assert "protective stop" in event["reason"]
    assert await server.client.event("HandTeachingMode") == {"robot_id": OBJ, "enabled": False}

    await do(server, "be", safety="normal")
    await server.ask("HandTeachingMode", {"robot_id": OBJ, "enable": True})
    await server.client.event("HandTeachingMode", lambda data: data["enabled"])
    await do(server, "be", safety="protective_stop")
    assert await server.client.event("HandTeachingMode") == {"robot_id": OBJ, "enabled": False}
    assert "protective stop" in (await server.client.event("Notification"))["message"]
    assert (await report(server))[2][-1] is False


@serving(with_arm)
async def test_any_client_can_stop_a_jog_and_going_offline_stops_it(server: Server) -> None:
    operator = await join(server, "olga", Role.OPERATOR)
    button = HoldButton(server)
    await button.jog(new=True)
    await server.ask("StopRobot", {"robot_id": OBJ}, operator)
    event = await operator.event("RobotHold", lambda data: not data["held"])
    assert "arm was stopped" in event["reason"]
    with pytest.raises(Arcor2Error):
        await button.jog()
    await button.jog(new=True)
    assert [outcome.stopped for outcome in (await server.ask("StopAll", client=operator)).outcomes] == [True]
    event = await operator.event("RobotHold", lambda data: not data["held"])
    assert event["reason"] == "olga stopped all motion"
    with pytest.raises(Arcor2Error):
        await button.jog()
    await button.jog(new=True)
    await server.ask("StopScene")
    event = await operator.event("RobotHold", lambda data: not data["held"])
    assert event["reason"]
    assert server.services.online.held.states() == []


@serving(with_arm)
async def test_hold_to_run_functions_that_a_type_lacks_are_refused(server: Server) -> None:
    server.types.robots["Arm"] = robot_meta("Arm", stop=True)
    button = HoldButton(server)
    with pytest.raises(RequestRefused, match="arm cannot be jogged"):
        await button.jog(new=True)
    with pytest.raises(RequestRefused, match="arm cannot be moved by hand"):
        await button.teach(new=True)
    with pytest.raises(RequestRefused, match="arm cannot be acknowledged from here"):
        await server.ask("AcknowledgeStop", {"object_id": OBJ})


# ---------------------------------------------------------------------------------------------- acknowledging
async def acknowledge(server: Server, client: Recorder | None = None, **args: Any) -> None:
    await server.ask("AcknowledgeStop", {"object_id": OBJ} | args, client)


@serving(with_arm)
async def test_acknowledging_a_protective_stop_records_the_operator(server: Server) -> None:
    subscribe(server, server.client)
    operator = await join(server, "olga", Role.OPERATOR)
    button = HoldButton(server)
    await button.jog(new=True)
    await do(server, "be", safety="protective_stop")
    with pytest.raises(Arcor2Error, match="protective stop of arm"):
        await button.jog()
    event = await server.client.event("RobotHold", lambda data: not data["held"])
    assert "protective stop" in event["reason"]
    with pytest.raises(Arcor2Error, match="protective stop of arm"):
        await button.jog(new=True)
    await acknowledge(server, operator)
    assert (await report(server))[3] == [["protective stop", "olga"]]
    with pytest.raises(Arcor2Error, match="press it again"):
        await button.jog()  # the button that is still pressed does not move the arm
    await button.jog(new=True)
    with pytest.raises(RequestRefused, match="arm is being moved by alice"):
        await acknowledge(server, operator)
    await button.jog(0)


@serving(with_arm)
async def test_acknowledging_is_refused_without_fault_or_role(server: Server) -> None:
    operator, technician = await join(server, "olga", Role.OPERATOR), await join(server, "tom", Role.TECHNICIAN)
    with pytest.raises(RequestRefused, match="no stop that could be"):
        await acknowledge(server, operator)
    for safety, text in (("emergency_stop", "where it was pressed"), ("safeguard_stop", "guard")):
        await do(server, "be", safety=safety)
        with pytest.raises(RequestRefused, match=text):
            await acknowledge(server, technician)
    for safety in ("fault", "violation"):
        await do(server, "be", safety=safety)
        with pytest.raises(RequestRefused, match="needs the role technician"):
            await acknowledge(server, operator)
        await acknowledge(server, technician)
    assert (await report(server))[3] == [["restart", "tom"]] * 2
    with pytest.raises(RequestRefused, match="not logged in"):
        await acknowledge(server, Recorder(None))
    with pytest.raises(RequestRefused, match="table is not a robot"):
        await acknowledge(server, object_id=TABLE)


@serving(with_arm)
async def test_an_alarm_of_any_device_is_acknowledged_by_code(server: Server) -> None:
    await acknowledge(server, code="E7")
    assert (await report(server))[3] == [["E7"]]
    with pytest.raises(Arcor2Error, match="no alarm E8"):
        await acknowledge(server, code="E8")
