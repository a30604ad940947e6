"""Latency of calls on one device while calls on eight others hang, through the server."""

import asyncio
import time
from pathlib import Path

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Pose
from benchmarks import server_process
from benchmarks.metrics import Metric, Report, percentile
from benchmarks.operation import add_type, scene_state

UNRESPONSIVE = 8
CALLS = 1000

ROBOT = '''"""A robot whose vendor library answers after {seconds:g} s."""

import time

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.objects import Robot


class {name}(Robot):
    """Answers after {seconds:g} s."""

    _ABSTRACT = False

    def get_end_effectors_ids(self) -> set[str]:
        return {{"flange"}}

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        return Pose()

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        return [Joint("joint", 0.0)]

    def grippers(self) -> set[str]:
        time.sleep({seconds})
        return {{"gripper"}}

    def suctions(self) -> set[str]:
        return set()
'''


async def call_durations(client: Client, robot: str, calls: int) -> list[float]:
    """Return the durations of calls on one robot, s."""
    samples = []
    for _ in range(calls):
        begin = time.perf_counter()
        await client.call("GetGrippers", rpc.GetGrippersArgs(robot))
        samples.append(time.perf_counter() - begin)
    return samples


async def run(report: Report, directory: Path) -> None:
    """Measure calls on a responsive robot while eight others hang."""
    async with server_process.server(directory / "hung") as (url, _), Client(url, "bench") as client:
        await add_type(url, "HungRobot", ROBOT.format(name="HungRobot", seconds=600.0))
        await add_type(url, "PromptRobot", ROBOT.format(name="PromptRobot", seconds=0.0))
        await client.call("NewScene", rpc.NewSceneArgs("hung"))
        ids = []
        for number, kind in enumerate(["PromptRobot", *["HungRobot"] * UNRESPONSIVE]):
            await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs(f"robot_{number}", kind, Pose()))
            ids.append((await client.next_event("SceneObjectChanged")).data.id)
        await client.call("StartScene")
        await scene_state(client, "started")
        alone = await call_durations(client, ids[0], CALLS // 4)
        hung = [asyncio.create_task(client.call("GetGrippers", rpc.GetGrippersArgs(each))) for each in ids[1:]]
        await asyncio.sleep(0.2)
        samples = await call_durations(client, ids[0], CALLS)
        under_way = sum(not task.done() for task in hung)
        for task in hung:
            task.cancel()
        await asyncio.gather(*hung, return_exceptions=True)
    if under_way != UNRESPONSIVE:
        raise RuntimeError(f"Only {under_way} of {UNRESPONSIVE} devices hung to the end.")
    note = f"alone {percentile(alone, 99) * 1e3:.1f} ms; all {UNRESPONSIVE} hung to the end"
    report.add(Metric("hung_beside_p99_ms", percentile(samples, 99) * 1e3, len(samples), note))
