"""The online scene: states, crashes, robots, single actions."""

import asyncio
import json
import os
import signal
from typing import Any

import pytest

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.project import (
    Action,
    ActionParameter,
    ActionPoint,
    Flow,
    NamedOrientation,
    Project,
    ProjectParameter,
    ProjectRobotJoints,
)
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import ConnectionLost
from arcor2_hw.messages import Message
from arcor2_server.errors import RequestRefused
from arcor2_server.hosts.process import CellError
from tests.runtime.conftest import scene_object
from tests.server.core.serving import until

from .conftest import Recorder, Server, action, robot_meta, serving

ARM = """
class Arm(Robot):
    _ABSTRACT = False
    CANCEL_MAPPING = {"pick": "give_up"}

    def __init__(self, obj_id, name, pose, settings=None):
        super().__init__(obj_id, name, pose, settings)
        self.stopped = threading.Event()
        self.given_up = threading.Event()
        self.hand = False
        self.owner = None
        self.at = Pose(Position(0.1, 0.2, 0.3))

    def take_control(self): self.owner = "us"
    def control_owner(self): return self.owner
    def get_end_effectors_ids(self): return {"tool"}
    def get_end_effector_pose(self, end_effector): return self.at
    def robot_joints(self, include_gripper=False):
        return [Joint("j0", 0.5)] + ([Joint("finger", 0.01)] if include_gripper else [])
    def grippers(self): return {"fingers"}
    def suctions(self): return set()
    def get_hand_teaching_mode(self): return self.hand
    def set_hand_teaching_mode(self, enabled): self.hand = enabled
    def inverse_kinematics(self, end_effector_id, pose, start_joints=None, avoid_collisions=True):
        if pose.position.z < 0:
            raise Robot.KinematicsException("below the table")
        return [Joint("j0", pose.position.x)]

    def stop(self): self.stopped.set()

    def move_to_pose(self, end_effector_id, target_pose: Pose, speed, safe=True, linear=True):
        if self.owner != "us":
            raise NotInControl("nobody has control")
        if target_pose.position.z > 1:
            self.stopped.clear()
            self.stopped.wait(300)
        self.at = target_pose

    def move_to_joints(self, target_joints: list[Joint], speed, safe=True):
        if target_joints[0].value > 3:
            raise OutOfRange("j0 ends at 3 rad")

    @action
    def measure(self, factor: float, *, an: str | None = None) -> tuple[float, str]:
        return factor * 2, "mm"

    @action
    def pick(self, where: Pose, offset: float, *, an: str | None = None) -> None:
        if offset > 5 and self.given_up.wait(300):
            self.given_up.clear()
            raise Cancelled("given up")
        if where.position.x != 2:
            raise Refused(f"wrong place {where.position.x}")

    def give_up(self): self.given_up.set()
    def vanish(self): os._exit(9)
    def freeze(self): ctypes.PyDLL(None).usleep(3_000_000)
"""
OBJ = "obj_arm"
META = robot_meta("Arm", move_to_pose=True, move_to_joints=True, stop=True, inverse_kinematics=True, hand_teaching=True)
SCENE = Scene("scene", id="scn_1", objects=[SceneObject("arm", "Arm", Pose(Position(1, 0, 0)), [], OBJ)])


def _pick(name: str, kind: str, value: Any) -> Action:
    parameters = [ActionParameter("where", "pose", '"ori_1"'), ActionParameter("offset", kind, json.dumps(value))]
    return Action(name, f"{OBJ}/pick", f"act_{name}", parameters, [Flow()])


PROJECT = Project(
    "project",
    "scn_1",
    id="pro_1",
    action_points=[
        ActionPoint(
            "top",
            Position(1, 0, 0),
            OBJ,
            id="acp_1",
            orientations=[NamedOrientation("o", Orientation(), "ori_1")],
            robot_joints=[ProjectRobotJoints("j", OBJ, [Joint("j0", 0.5)], True, id="joi_1")],
            actions=[
                Action(
                    "measure",
                    f"{OBJ}/measure",
                    "act_measure",
                    [ActionParameter("factor", "project_parameter", '"pco_1"')],
                    [Flow(outputs=["size", "unit"])],
                ),
                _pick("literal", "double", 1.0),
                _pick("linked", "link", "act_measure/default/0"),
                _pick("long", "double", 9.0),
            ],
        )
    ],
    parameters=[ProjectParameter("factor", "double", "1.5", id="pco_1")],
)


async def with_arm(server: Server) -> None:
    server.types.add("Arm", ARM, [action("measure", "double", "string"), action("pick", cancellable=True)], META)
    await server.open(SCENE, PROJECT)


@serving()
async def test_a_setting_cannot_name_a_file_outside_the_device_files(server: Server) -> None:
    source = """
    from arcor2_hw.objects.settings import device_file

    @dataclass
    class BoxSettings(Settings):
        file: str
        def __post_init__(self): self.file = device_file("file", self.file)

    class Box(Generic):
        _ABSTRACT = False
        def __init__(self, obj_id, name, settings: BoxSettings):
            super().__init__(obj_id, name, settings)
        def connect(self, timeout=5.0):
            Path(self.settings.file).write_text("")
    """
    server.types.add("Box", source)
    data_dir = server.services.settings.data_dir
    tokens = data_dir / "tokens.json"
    tokens.write_text("[]")
    await server.open(Scene("scene", id="scn_1", objects=[scene_object("box", "Box", file=str(tokens))]))
    await server.ask("StartScene")
    refused = await server.client.state("stopping")
    assert f"file must be in {data_dir / 'device-files'}" in refused["message"]
    assert tokens.read_text() == "[]"
    await server.client.state("stopped")
    (data_dir / "device-files").mkdir()
    await server.open(Scene("scene", id="scn_1", objects=[scene_object("box", "Box", file="box.txt")]))
    await server.start()
    assert (data_dir / "device-files" / "box.txt").exists()


@serving(with_arm)
async def test_a_scene_starts_and_stops(server: Server) -> None:
    cell, client = server.services.online, server.client
    unexpected: list[Message] = []
    cell.host.on_death.append(unexpected.append)
    with pytest.raises(RequestRefused):
        await server.ask("StopScene")
    await server.ask("StartScene")
    with pytest.raises(RequestRefused):
        await server.ask("StartScene")
    await client.state("started")
    assert cell.online
    assert server.services.locks.locked_roots() == []
    assert [(d.name, d.type, d.answering) for d in cell.board.statuses()] == [("arm", "Arm", True)]
    with pytest.raises(RequestRefused):
        await server.ask("StartScene")
    await server.ask("StopScene")
    await client.state("stopped")
    assert not cell.online
    assert unexpected == []
    await server.start()


@serving(with_arm)
async def test_scene_states_are_sent_in_order_after_the_answer(server: Server) -> None:
    await server.ask("StartScene")
    await server.client.event("response StartScene")
    states = [(await server.client.event("SceneState")) for _ in range(2)]
    assert states == [{"state": "starting"}, {"state": "started"}]


@serving()
async def test_a_failed_start_gives_the_reason_and_can_be_repeated(server: Server) -> None:
    source = """
    @dataclass
    class BoxSettings(Settings):
        file: str

    class Box(Generic):
        _ABSTRACT = False
        def __init__(self, obj_id, name, settings: BoxSettings):
            super().__init__(obj_id, name, settings)
        def connect(self, timeout=5.0):
            if not os.path.exists(self.settings.file):
                raise NotConnected("nobody at 192.0.2.7:502")
    """
    server.types.add("Box", source)
    path = server.services.settings.data_dir / "switch"
    await server.open(Scene("scene", id="scn_1", objects=[scene_object("box", "Box", file=str(path))]))
    await server.ask("StartScene")
    states = [await server.client.event("SceneState") for _ in range(3)]
    assert [s["state"] for s in states] == ["starting", "stopping", "stopped"]
    assert "box" in states[1]["message"]
    assert "192.0.2.7:502" in states[1]["message"]
    path.write_text("")
    await server.start()


@serving(with_arm)
async def test_a_crash_takes_the_scene_offline(server: Server) -> None:
    await server.start()
    cell = server.services.online
    unexpected: list[Message] = []
    cell.host.on_death.append(unexpected.append)
    assert cell.host.host is not None
    call = asyncio.create_task(cell.call(OBJ, "pick", {"where": Pose(), "offset": 9.0}))
    await asyncio.sleep(0.05)
    os.kill(cell.host.host.pid, signal.SIGKILL)
    stopped = await server.client.state("stopped")
    assert "SIGKILL" in stopped["message"]
    with pytest.raises(ConnectionLost):
        await call
    assert [reason.text for reason in unexpected] == ["the cell host was killed by SIGKILL"]
    await server.start()


@serving(with_arm)
async def test_a_driver_that_ends_the_process_takes_the_scene_offline(server: Server) -> None:
    await server.start()
    with pytest.raises(ConnectionLost):
        await server.services.online.call(OBJ, "vanish")
    assert "status 9" in (await server.client.state("stopped"))["message"]


@serving()
async def test_a_driver_that_ends_the_process_while_connecting_stops_the_start(server: Server) -> None:
    server.types.add(
        "Bomb", "class Bomb(Generic):\n    _ABSTRACT = False\n    def connect(self, timeout=5.0): os._exit(11)\n"
    )
    await server.open(Scene("scene", id="scn_1", objects=[scene_object("bomb", "Bomb")]))
    for _ in range(2):
        await server.ask("StartScene")
        states = [await server.client.event("SceneState") for _ in range(3)]
        assert [s["state"] for s in states] == ["starting", "stopping", "stopped"]
        assert "status 11" in states[1]["message"]
    assert server.services.locks.locked_roots() == []


@serving(with_arm)
async def test_an_unresponsive_host_is_reported_and_may_recover(server: Server) -> None:
    await server.start()
    cell = server.services.online
    server.services.hub.subscribe(server.client, {"ObjectState"}, True)  # type: ignore[arg-type]
    call = asyncio.create_task(cell.call(OBJ, "freeze"))
    state = await server.client.event("ObjectState", lambda data: data.get("answering") is False)
    assert not call.done()
    assert state == {"object_id": OBJ, "state": "online", "answering": False}
    assert not cell.board.statuses()[0].answering
    assert cell.board.states()[0].answering is False, "new subscribers are notified, too"
    await call
    assert await server.client.event("ObjectState") == {"object_id": OBJ, "state": "online"}
    assert cell.board.statuses()[0].answering
    assert cell.online


@serving(with_arm)
async def test_robot_metadata_and_poses_are_returned(server: Server) -> None:
    with pytest.raises(RequestRefused):
        await server.ask("GetRobotJoints", {"robot_id": OBJ})
    await server.start()
    assert await server.ask("GetRobotJoints", {"robot_id": OBJ}) == [Joint("j0", 0.5)]
    assert await server.ask("GetEndEffectors", {"robot_id": OBJ}) == ["tool"]
    assert await server.ask("GetGrippers", {"robot_id": OBJ}) == ["fingers"]
    assert await server.ask("GetSuctions", {"robot_id": OBJ}) == []
    pose = await server.ask("GetEndEffectorPose", {"robot_id": OBJ, "end_effector_id": "tool"})
    assert pose == Pose(Position(0.1, 0.2, 0.3))
    for refused, args in [
        ("GetRobotArms", {"robot_id": OBJ}),
        ("GetRobotJoints", {"robot_id": OBJ, "arm_id": "left"}),
        ("GetEndEffectorPose", {"robot_id": OBJ, "end_effector_id": "other"}),
    ]:
        with pytest.raises(RequestRefused):
            await server.ask(refused, args)
    pose = {"position": {"x": 0.7, "y": 0, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
    args = {"robot_id": OBJ, "end_effector_id": "tool", "pose": pose}
    assert await server.ask("InverseKinematics", args) == [Joint("j0", 0.7)]
    pose["position"]["z"] = -1
    with pytest.raises(CellError, match="below the table"):
        await server.ask("InverseKinematics", args)


@serving(with_arm)
async def test_streams_are_sent_only_to_subscribers(server: Server) -> None:
    await server.start()
    other = Recorder("bob")
    server.services.hub.add(other)  # type: ignore[arg-type]
    subscribe = {"robot_id": OBJ, "what": "joints", "send": True}
    await server.ask("RegisterForRobotEvent", subscribe)
    for _ in range(2):
        data = await server.client.event("RobotJoints")
    assert [j["name"] for j in data["joints"]] == ["j0", "finger"]
    assert other.got == []
    await server.ask("RegisterForRobotEvent", subscribe | {"send": False})
    with pytest.raises(RequestRefused):
        await server.ask("RegisterForRobotEvent", subscribe | {"send": False})


@serving(with_arm)
async def test_a_motion_reports_start_and_end(server: Server) -> None:
    await server.start()
    locks = server.services.locks
    request = {"robot_id": OBJ, "end_effector_id": "tool", "speed": 0.5, "position": {"x": 1, "y": 0, "z": 0}}
    await server.ask("MoveToPose", request)
    await server.client.event("response MoveToPose")
    start = await server.client.event("RobotMoveToPose")
    assert start["move_event_type"] == "start"
    assert start["target_pose"]["position"]["x"] == 1
    assert "message" not in start
    assert (await server.client.event("RobotMoveToPose"))["move_event_type"] == "end"
    assert locks.writer_of(OBJ) is None
    for wrong in ({"speed": 0.0}, {"speed": 1.5}):
        with pytest.raises(RequestRefused):
            await server.ask("MoveToPose", request | wrong)
    await server.ask("MoveToJoints", {"robot_id": OBJ, "speed": 0.5, "joints": [{"name": "j0", "value": 4}]})
    failed = await server.client.event("RobotMoveToJoints", lambda d: d["move_event_type"] != "start")
    assert failed["move_event_type"] == "failed"
    assert "3 rad" in failed["message"]
    assert locks.writer_of(OBJ) is None


@serving(with_arm)
async def test_stop_robot_stops_the_motion(server: Server) -> None:
    await server.start()
    with pytest.raises(RequestRefused):
        await server.ask("StopRobot", {"robot_id": OBJ})
    request = {"robot_id": OBJ, "end_effector_id": "tool", "speed": 0.5, "position": {"x": 0, "y": 0, "z": 2}}
    await server.ask("MoveToPose", request)
    assert server.services.locks.writer_of(OBJ) == "alice"
    with pytest.raises(RequestRefused):
        await server.ask("MoveToActionPoint", {"robot_id": OBJ, "speed": 0.5, "joints_id": "joi_1"})
    await server.ask("StopRobot", {"robot_id": OBJ})
    failed = await server.client.event("RobotMoveToPose", lambda d: d["move_event_type"] != "start")
    assert failed["move_event_type"] == "failed"
    assert server.services.locks.writer_of(OBJ) is None


@serving(with_arm)
async def test_a_robot_moves_to_the_poses_and_joints_of_action_points(server: Server) -> None:
    await server.start()
    args = {"robot_id": OBJ, "speed": 0.5, "orientation_id": "ori_1", "end_effector_id": "tool"}
    await server.ask("MoveToActionPoint", args)
    name = "RobotMoveToActionPointOrientation"
    assert (await server.client.event(name, lambda d: d["move_event_type"] == "end"))["orientation_id"] == "ori_1"
    pose = await server.ask("GetEndEffectorPose", {"robot_id": OBJ, "end_effector_id": "tool"})
    assert pose.position == Position(2, 0, 0)  # the parent of the point is the arm at x = 1
    await server.ask("MoveToActionPoint", {"robot_id": OBJ, "speed": 0.5, "joints_id": "joi_1"})
    await server.client.event("RobotMoveToActionPointJoints", lambda d: d["move_event_type"] == "end")


@serving(with_arm)
async def test_steps_and_hand_teaching_need_the_lock(server: Server) -> None:
    await server.start()
    step = {"robot_id": OBJ, "end_effector_id": "tool", "axis": "x", "what": "position", "mode": "world", "step": 0.1}
    teach = {"robot_id": OBJ, "enable": True}
    for name, args in (("StepRobotEef", step), ("HandTeachingMode", teach)):
        with pytest.raises(RequestRefused):
            await server.ask(name, args)
    await server.services.locks.write_lock("alice", OBJ)
    await server.ask("StepRobotEef", step)
    end = await server.client.event("RobotMoveToPose", lambda d: d["move_event_type"] == "end")
    assert end["target_pose"]["position"] == {"x": pytest.approx(0.2), "y": 0.2, "z": 0.3}
    await server.ask("HandTeachingMode", teach)
    assert await server.client.event("HandTeachingMode") == {"robot_id": OBJ, "enabled": True}
    with pytest.raises(RequestRefused):
        await server.ask("HandTeachingMode", teach)
    with pytest.raises(RequestRefused, match="by hand"):
        await server.ask("StepRobotEef", step)


async def _execute(server: Server, action_id: str) -> dict[str, Any]:
    await server.ask("ExecuteAction", {"action_id": action_id})
    await server.client.event("response ExecuteAction")
    assert await server.client.event("ActionExecution") == {"action_id": action_id}
    return await server.client.event("ActionResult")


@serving(with_arm)
async def test_a_single_action_uses_project_parameters_and_earlier_results(server: Server) -> None:
    with pytest.raises(RequestRefused):
        await server.ask("ExecuteAction", {"action_id": "act_literal"})
    await server.start()
    assert await _execute(server, "act_literal") == {"action_id": "act_literal"}
    with pytest.raises(RequestRefused, match="measure"):
        await server.ask("ExecuteAction", {"action_id": "act_linked"})
    assert await _execute(server, "act_measure") == {"action_id": "act_measure", "results": ["3.0", '"mm"']}
    assert await _execute(server, "act_linked") == {"action_id": "act_linked"}
    with pytest.raises(RequestRefused):
        await server.ask("CancelAction")


@serving(with_arm)
async def test_a_single_action_can_be_cancelled(server: Server) -> None:
    await server.start()
    await server.ask("ExecuteAction", {"action_id": "act_long"})
    await server.client.event("ActionExecution")
    for refused, args in (("ExecuteAction", {"action_id": "act_literal"}), ("StopScene", None)):
        with pytest.raises(RequestRefused):
            await server.ask(refused, args)
    await server.ask("CancelAction")
    await server.client.event("ActionCancelled")
    await until(lambda: server.services.online.running_action is None)
    assert all(event["event"] != "ActionResult" for event in server.client.got)
    await _execute(server, "act_literal")


@serving(with_arm)
async def test_an_action_interrupted_by_a_crash_ends_with_an_error(server: Server) -> None:
    await server.start()
    await server.ask("ExecuteAction", {"action_id": "act_long"})
    assert server.services.online.host.host is not None
    server.services.online.host.host.kill()
    assert "SIGKILL" in (await server.client.event("ActionResult"))["error"]
    assert server.services.online.running_action is None
    assert server.services.online.results == {}


@serving(with_arm)
async def test_moving_an_object_updates_the_running_scene(server: Server) -> None:
    await server.start()
    await server.services.online.object_pose_changed(OBJ, Pose(Position(5, 0, 0)))
    raw = await server.services.online.call(OBJ, "pose")
    assert json.loads(raw)["position"]["x"] == 5
