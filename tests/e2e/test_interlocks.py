"""The fake arm enters a zone only while the door of the fake tester is confirmed open, as their joint log shows."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.events import MoveEventType, SceneStateEnum
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.interlocks import Interlock, InterlockStates, InterlockTarget
from arcor2_hw.data.object_type import Box, Model3dType, ObjectModel
from arcor2_hw.data.parameter import Parameter
from arcor2_server.demo.fakes import free_loopback_address
from tests.docs.test_interlocks_page import CLIENT
from tests.e2e.harness import Cell, running_cell, scene_state, until

ZONE = "inside"
DOWN = 0.15
"""Distance of the arm from its start into the zone, m; the zone begins 0.05 m above its end."""


CYCLES = 4
"""Number of times that each of two arms enters the zone."""


class JointLog:
    """Record of the fakes: the state of the door, and whether the arm is in the zone."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self.lines: list[tuple[str, str]] = []
        self._start = 0.0

    @contextlib.asynccontextmanager
    async def recording(self) -> AsyncIterator[None]:
        self._start = await height(self.cell, "robot")
        task = asyncio.create_task(self._follow())
        try:
            yield
        finally:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task

    async def _follow(self) -> None:
        while True:
            # Read the arm first: a line with an open door and an arm inside cannot come from an arm that was too early.
            inside = self._start - await height(self.cell, "robot") > DOWN - 0.05
            door = (await self.cell.command_fake("tester", "truth"))["door"]
            line = (door, "inside" if inside else "outside")
            if not self.lines or line != self.lines[-1]:
                self.lines.append(line)
            await asyncio.sleep(0.01)


class Arm:
    """The arm, which moves on requests."""

    def __init__(self, client: Client, robot_id: str) -> None:
        self.client, self.id = client, robot_id

    async def pose(self) -> Pose:
        found: Pose = await self.client.call("GetEndEffectorPose", rpc.GetEndEffectorPoseArgs(self.id, "tcp"))
        return found

    async def move(self, to: Pose, speed: float) -> None:
        arguments = rpc.MoveToPoseArgs(self.id, "tcp", speed, to.position, to.orientation, safe=False)
        await self.client.call("MoveToPose", arguments)

    async def wait_for_end(self) -> str:
        """Wait for the end of the motion. Return the reason of a failure, or an empty text."""
        while True:
            event = await self.client.next_event("RobotMoveToPose", timeout=60)
            if event.data.move_event_type is not MoveEventType.START:
                return str(event.data.message or "")


@pytest.mark.asyncio
async def test_the_arm_enters_only_while_the_door_is_confirmed_open(tmp_path: Path) -> None:
    async with running_cell(tmp_path) as cell:
        client = await cell.client("technician")
        scene, _ = await cell.open(client)
        ids = {obj.name: obj.id for obj in scene.objects}
        await client.call("StartScene")
        await scene_state(client, SceneStateEnum.STARTED)
        arm = Arm(client, ids["robot"])
        start = await arm.pose()
        await arm.move(start, 0.5)  # takes control, which sets the tool
        assert await arm.wait_for_end() == ""
        await client.call("StopScene")
        await scene_state(client, SceneStateEnum.STOPPED)

        inside = Pose(start.position + Position(0.0, 0.0, -DOWN), start.orientation)
        model = ObjectModel(Model3dType.BOX, Box(ZONE, 0.2, 0.2, 0.1))
        at = Pose(inside.position)
        await client.call("AddSceneShape", rpc.AddVirtualCollisionObjectToSceneArgs(ZONE, at, model))
        zone = (await client.next_event("SceneObjectChanged")).data.id
        page: dict[str, Any] = {}
        exec(CLIENT, page)
        await page["wait_for_door"](client, zone, ids["tester"])
        await client.call("SubscribeEvents", rpc.SubscribeEventsArgs({"InterlockStates"}))
        await client.call("StartScene")
        await scene_state(client, SceneStateEnum.STARTED)
        await arm.move(start, 0.5)
        assert await arm.wait_for_end() == ""

        log = JointLog(cell)
        async with log.recording():
            await arm.move(inside, 0.5)
            while not (await states(client)).interlocks[0].waiting:
                pass
            await cell.command_fake("tester", "push_door", opening=True)
            assert await arm.wait_for_end() == ""
            assert ("open", "inside") in log.lines
            # The door closes while the arm moves slowly out.
            await arm.move(start, 0.02)
            await until(partial(is_moving, cell, "robot"), "the arm moves")
            await cell.command_fake("tester", "push_door", opening=False)
            reason = await arm.wait_for_end()
            assert reason.startswith("robot: move_to_pose was stopped. Interlock Door: tester: door open is not met")
            await until(lambda: log.lines[-1] == ("closed", "inside"), "the door is closed")
        assert not [line for line in log.lines[: log.lines.index(("open", "inside"))] if line[1] == "inside"]

        aside = rpc.JogRobotArgs(ids["robot"], 1, 0.0, 300, linear=Position(0.05, 0.0, 0.0))
        await client.call("WriteLock", rpc.WriteLockArgs(ids["robot"]))
        with pytest.raises(RequestFailed, match="may only move out of the zone"):
            await client.call("JogRobot", aside)
        await client.call("WriteUnlock", rpc.WriteUnlockArgs(ids["robot"]))
        await cell.command_fake("tester", "push_door", opening=True)
        await arm.move(start, 0.5)
        assert await arm.wait_for_end() == ""


@pytest.mark.asyncio
async def test_two_fake_arms_never_share_a_zone(tmp_path: Path) -> None:
    second = free_loopback_address()
    async with running_cell(tmp_path) as cell:
        await cell.start_fake("second", "ur", "--host", second)
        client = await cell.client("technician")
        scene, _ = await cell.open(client)
        robot = next(obj for obj in scene.objects if obj.name == "robot")
        assert isinstance(robot.pose, Pose)
        beside = Pose(robot.pose.position + Position(0.0, 0.1, 0.0), robot.pose.orientation)
        settings = [
            Parameter(each.name, each.type, f'"{second}"') if each.name == "host" else each for each in robot.parameters
        ]
        await client.call("AddSceneObject", rpc.AddObjectToSceneArgs("second", robot.type, beside, settings))
        other = (await client.next_event("SceneObjectChanged")).data.id
        await client.call("StartScene")
        await scene_state(client, SceneStateEnum.STARTED)
        arms = {"robot": Arm(client, robot.id), "second": Arm(client, other)}
        above = {}
        for name, arm in arms.items():
            await arm.move(await arm.pose(), 0.5)  # takes control, which sets the tool
            assert await arm.wait_for_end() == ""
            above[name] = await arm.pose()
        await client.call("StopScene")
        await scene_state(client, SceneStateEnum.STOPPED)
        middle = above["robot"].position + Position(0.0, 0.05, -DOWN)
        model = ObjectModel(Model3dType.BOX, Box(ZONE, 0.3, 0.3, 0.1))
        await client.call("AddSceneShape", rpc.AddVirtualCollisionObjectToSceneArgs(ZONE, Pose(middle), model))
        zone = (await client.next_event("SceneObjectChanged")).data.id
        shared = Interlock("Shared", InterlockTarget.ZONE, zone, within=60.0)
        await client.call("PutInterlock", rpc.PutInterlockArgs(shared))
        await client.call("StartScene")
        await scene_state(client, SceneStateEnum.STARTED)

        heights = {name: await height(cell, name) for name in arms}
        occupied: list[set[str]] = [set()]

        async def follow() -> None:
            while True:
                inside = {name for name in arms if heights[name] - await height(cell, name) > DOWN - 0.05}
                if inside != occupied[-1]:
                    occupied.append(inside)

        following = asyncio.create_task(follow())
        ends = dict.fromkeys(arms, 0)
        for name, arm in arms.items():
            await arm.move(lowered(above[name]), 1.0)
        while min(ends.values()) < 2 * CYCLES:
            data = (await client.next_event("RobotMoveToPose", timeout=60)).data
            if data.move_event_type is MoveEventType.START:
                continue
            assert data.move_event_type is MoveEventType.END, data.message
            name = next(each for each, arm in arms.items() if arm.id == data.robot_id)
            ends[name] += 1
            if ends[name] < 2 * CYCLES:
                await arms[name].move(above[name] if ends[name] % 2 else lowered(above[name]), 1.0)
        following.cancel()
        assert max(map(len, occupied)) == 1
        for name in arms:
            assert sum(name in inside for inside in occupied) >= CYCLES


def lowered(pose: Pose) -> Pose:
    return Pose(pose.position + Position(0.0, 0.0, -DOWN), pose.orientation)


async def height(cell: Cell, robot: str) -> float:
    """Return the height of the tool in the fake, m."""
    return float((await cell.command_fake(robot, "truth"))["tcp_pose"][2])


async def is_moving(cell: Cell, robot: str) -> bool:
    """Return whether the fake arm moves."""
    return any(abs(speed) > 1e-3 for speed in (await cell.command_fake(robot, "truth"))["qd"])


async def states(client: Client) -> InterlockStates:
    """Return the next states that name at least one interlock."""
    while True:
        found: InterlockStates = (await client.next_event("InterlockStates", timeout=30)).data
        if found.interlocks:
            return found
