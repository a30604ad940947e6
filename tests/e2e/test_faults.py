"""Faults of the whole product: cut cables, pressed stops, killed processes."""

import asyncio
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.base import Unset
from arcor2_hw.data.editor import RunEnd
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.held import HoldChoice, OnError
from arcor2_hw.data.object_type import Again
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.project import Project
from arcor2_hw.exceptions import ConnectionLost
from tests.e2e.harness import Cell, alive, kill, running_cell, scene_state, until

REST_JOINT_SPEED = 1e-3
"""Speed below which a joint counts as stopped, rad/s."""


@pytest.fixture
async def cell(tmp_path: Path) -> AsyncIterator[Cell]:
    async with running_cell(tmp_path) as running:
        yield running


@pytest.fixture
async def running(tmp_path: Path) -> AsyncIterator[Cell]:
    """Start a cell with the small world, so that programs can pick boards."""
    async with running_cell(tmp_path, boards=3, seed=4) as cell:
        yield cell


async def robot_truth(cell: Cell) -> dict[str, Any]:
    truth: dict[str, Any] = await cell.command_fake("robot", "truth")
    return truth


async def is_moving(cell: Cell) -> bool:
    return max(abs(v) for v in (await robot_truth(cell))["qd"]) > 0.2


async def is_stopped(cell: Cell) -> bool:
    return max(abs(v) for v in (await robot_truth(cell))["qd"]) < REST_JOINT_SPEED


async def assert_standstill(cell: Cell, seconds: float) -> None:
    """Assert that no joint moves for this time."""
    before = (await robot_truth(cell))["q"]
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        now = (await robot_truth(cell))["q"]
        assert max(abs(a - b) for a, b in zip(before, now, strict=True)) < 1e-3, "the arm moved by itself"
        await asyncio.sleep(0.05)


async def go_online(cell: Cell, client: Client) -> Project:
    _, project = await cell.open(client)
    await client.call("StartScene")
    await scene_state(client, SceneStateEnum.STARTED)
    return project


def action_id(project: Project, name: str) -> str:
    return next(a.id for point in project.action_points for a in point.actions if a.name == name)


async def start_moving(cell: Cell, client: Client, project: Project) -> None:
    """Execute the action that picks from the feeder; return while the arm moves."""
    await client.call("ExecuteAction", rpc.ExecuteActionArgs(action_id(project, "pick")))
    await until(lambda: is_moving(cell), "the arm moves")


async def program_in_mid_move(cell: Cell, client: Client) -> None:
    _, project = await cell.open(client, boards=3)
    package = await cell.build(client, project)
    await client.call("RunPackage", rpc.RunPackageArgs(package))
    await until(lambda: is_moving(cell), "the arm moves")


async def program_error(client: Client) -> str:
    """Return the text of the ProjectException that precedes PackageState stopped."""
    text = ""
    while True:
        event = await client.next_event("ProjectException", "PackageState", timeout=30)
        if event.event == "ProjectException":
            text = event.data.message
        elif event.data.state is PackageStateEnum.STOPPED:
            return text


# ---------------------------------------------------------------------------------------------------- starting a scene
async def test_robot_off_at_start_is_named_and_a_later_start_works(cell: Cell) -> None:
    client = await cell.client("technician")
    await cell.open(client)
    await cell.kill("robot")
    await client.call("StartScene")
    event = await scene_state(client, SceneStateEnum.STOPPED)
    assert not isinstance(event.data.message, Unset)
    assert "robot" in event.data.message
    assert cell.robot_host in event.data.message
    await client.call("SystemInfo")
    await cell.start_robot()
    await client.call("StartScene")
    await scene_state(client, SceneStateEnum.STARTED)


async def test_joints_are_shown_and_control_is_refused_while_another_program_runs(cell: Cell) -> None:
    await cell.command_fake("robot", "foreign_program", on=True)
    playing = (await robot_truth(cell))["program"]
    assert playing is not None
    client = await cell.client("operator")
    project = await go_online(cell, client)
    scene = await client.call("GetScene", rpc.IdArgs(project.scene_id))
    robot = next(obj.id for obj in scene.objects if obj.name == "robot")
    joints = await client.call("GetRobotJoints", rpc.GetRobotJointsArgs(robot))
    truth = await robot_truth(cell)
    assert len(joints) == 6
    assert [joint.value for joint in joints] == pytest.approx(truth["q"], abs=0.2)
    await client.call("ExecuteAction", rpc.ExecuteActionArgs(action_id(project, "pick")))
    result = (await client.next_event("ActionResult", timeout=30)).data
    assert not isinstance(result.error, Unset)
    assert playing in result.error  # the message names the owner of control
    assert (await robot_truth(cell))["program"] == playing
    assert (await robot_truth(cell))["programs_killed"] == truth["programs_killed"]


# ---------------------------------------------------------------------------------------------------- during a move
@pytest.mark.parametrize(
    "fault", ["silence", *(pytest.param(each, marks=pytest.mark.matrix) for each in ("reset", "half_frame"))]
)
async def test_a_cable_cut_during_a_move_fails_the_action_and_nothing_moves_again(running: Cell, fault: str) -> None:
    client = await running.client("operator")
    await program_in_mid_move(running, client)
    await running.command_fake("robot", fault)
    text = await program_error(client)
    assert "robot" in text, text
    await until(lambda: is_stopped(running), "standstill")
    await running.command_fake("robot", "heal")
    await assert_standstill(running, 2.0)
    await client.call("SystemInfo")


async def test_a_protective_stop_is_named_and_stays_until_unlocked(running: Cell) -> None:
    client = await running.client("operator")
    await program_in_mid_move(running, client)
    await running.command_fake("robot", "protective_stop")
    text = await program_error(client)
    assert "protective stop" in text.lower(), text
    await assert_standstill(running, 6.0)  # the controller refuses to unlock for 5 s: no attempt may follow
    assert (await robot_truth(running))["safety"] == "PROTECTIVE_STOP"


async def test_operator_recovers_a_program_held_by_a_protective_stop(running: Cell) -> None:
    client = await running.client("operator")
    await client.subscribe_events({"Held"})
    _, project = await running.open(client, boards=1)
    package = await running.build(client, project)
    await client.call("RunPackage", rpc.RunPackageArgs(package, on_error=OnError.HOLD))
    await until(lambda: is_moving(running), "the arm moves")
    await running.command_fake("robot", "protective_stop")
    held = (await client.next_event("Held", timeout=30)).data
    assert (held.action_name, held.kind, held.again) == ("pick", "safety_stop", Again.ASK)
    await until(lambda: is_stopped(running), "standstill")

    async def acknowledged() -> bool:
        try:  # the controller refuses to unlock for 5 s
            await client.call("AcknowledgeStop", rpc.AcknowledgeStopArgs(held.device))
        except RequestFailed:
            await asyncio.sleep(0.5)  # each refused attempt takes processor time
            return False
        return True

    await until(acknowledged, "the stop is acknowledged")
    await assert_standstill(running, 1.0)
    with pytest.raises(RequestFailed, match="Confirm"):
        await client.call("DecideHeld", rpc.DecideHeldArgs(held.number, HoldChoice.RETRY))
    await assert_standstill(running, 0.5)
    await client.call("DecideHeld", rpc.DecideHeldArgs(held.number, HoldChoice.RETRY, confirmed=True))
    assert await program_error(client) == ""
    trace = (await client.call("GetExecutionTrace")).entries
    assert [entry.name for entry in trace if not isinstance(entry.hold, Unset)] == ["pick"]
    assert (await client.call("ListRuns")).runs[0].end is RunEnd.FINISHED


async def test_nothing_moves_after_a_safeguard_stop_until_a_new_command(cell: Cell) -> None:
    client = await cell.client("operator")
    project = await go_online(cell, client)
    await start_moving(cell, client, project)
    await cell.command_fake("robot", "safeguard_stop", on=True)
    result = (await client.next_event("ActionResult", timeout=30)).data
    assert not isinstance(result.error, Unset)
    assert "safeguard" in result.error.lower()
    await cell.command_fake("robot", "safeguard_stop", on=False)
    await until(lambda: is_stopped(cell), "standstill")
    await assert_standstill(cell, 2.0)
    await start_moving(cell, client, project)


# ---------------------------------------------------------------------------------------------------- killed processes
async def test_the_arm_stops_when_the_cell_host_is_killed(cell: Cell) -> None:
    client = await cell.client("operator")
    project = await go_online(cell, client)
    (busy, *_) = [p for p in cell.hosts() if any(c.raddr and c.raddr.port == 30004 for c in p.net_connections())]
    await start_moving(cell, client, project)
    kill(busy.pid)
    event = await scene_state(client, SceneStateEnum.STOPPED)
    await until(lambda: is_stopped(cell), "standstill")
    assert not isinstance(event.data.message, Unset)
    await client.call("StartScene")
    await scene_state(client, SceneStateEnum.STARTED)
    await start_moving(cell, client, project)


async def test_server_killed_while_a_program_runs_stops_the_motion_and_ends_the_host(running: Cell) -> None:
    client = await running.client("operator")
    await program_in_mid_move(running, client)
    hosts = [p.pid for p in running.hosts()]
    assert hosts
    await running.kill("server")
    await until(lambda: is_stopped(running), "standstill")
    await until(lambda: not any(alive(pid) for pid in hosts), "the hosts have ended")
    await assert_standstill(running, 1.0)


async def test_every_acknowledged_edit_survives_a_killed_server(cell: Cell) -> None:
    client = await cell.client("author")
    _, project = await cell.open(client)
    acknowledged: set[str] = set()

    async def edit() -> None:
        for number in range(100_000):
            await client.call("AddActionPoint", rpc.AddActionPointArgs(f"point_{number}", Position(number, 0, 0)))
            acknowledged.add(f"point_{number}")

    editing = asyncio.create_task(edit())
    await until(lambda: len(acknowledged) >= 50, "some edits")
    await cell.kill("server")
    with pytest.raises(ConnectionLost):
        await editing
    assert len(acknowledged) >= 50
    await cell.start_server()
    reconnected = await cell.client("author")
    event = await reconnected.next_event("OpenProject", timeout=60)
    assert event.data.project.id == project.id
    names = {point.name for point in event.data.project.action_points}
    assert acknowledged <= names
    with pytest.raises(RequestFailed):
        await reconnected.call("CloseProject")  # there are unsaved changes
    await reconnected.call("SaveProject")
