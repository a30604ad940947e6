"""The UR5e through the whole product: stop latency, 500 Hz state stream, end of a jog."""

import asyncio
import random
import sys
import time
from pathlib import Path
from typing import Any

import msgspec

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.robot import Joint
from arcor2_server.demo.fakes import free_loopback_address
from arcor2_server.demo.processes import Child, python_module
from benchmarks import hold_to_run, server_process
from benchmarks.metrics import Metric, Report, median, percentile
from benchmarks.operation import scene_state

STREAM_SECONDS = 60.0
START_TIMEOUT = 3.0
"""Time limit for the start of a motion, including taking control, s."""


async def ask(control: str, do: str, **arguments: Any) -> Any:
    """Send a command to the fake over its control channel; return its data."""
    host, _, port = control.rpartition(":")
    reader, writer = await asyncio.open_connection(host, int(port), limit=1 << 24)
    try:
        writer.write(msgspec.json.encode({"id": 1, "do": do, **arguments}) + b"\n")
        answer = msgspec.json.decode(await reader.readline())
    finally:
        writer.close()
    if not answer["ok"]:
        raise RuntimeError(f"{do}: {answer['error']}")
    return answer["data"]


async def moved(client: Client, robot: str, target: list[Joint]) -> None:
    """Move to joints and wait until the motion ends; this also takes control."""
    await client.call("MoveToJoints", rpc.MoveToJointsArgs(robot, 0.5, target))
    while (await client.next_event("RobotMoveToJoints")).data.move_event_type == "start":
        pass


async def stop_latency(report: Report, directory: Path, host: str, control: str, n: int = 200) -> None:
    """Measure from sending StopAll to the stop at the controller and to the response, at random phases."""
    async with server_process.server(directory / "robot") as (url, _), Client(url, "bench") as client:
        await client.call("NewScene", rpc.NewSceneArgs("robot"))
        settings = [Parameter("host", "string", f'"{host}"'), Parameter("payload_mass", "double", "0.5")]
        await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs("robot", "UR5e", Pose(), settings))
        robot = (await client.next_event("SceneObjectChanged")).data.id
        await client.call("StartScene")
        await scene_state(client, "started")
        home: list[Joint] = await client.call("GetRobotJoints", rpc.GetRobotJointsArgs(robot))
        # Far enough apart that no motion ends before it is stopped.
        targets = [
            [Joint(joint.name, joint.value + (turn if index == 0 else 0.0)) for index, joint in enumerate(home)]
            for turn in (1.5, -1.5)
        ]
        # The first motion takes control and is not measured.
        await moved(client, robot, targets[1])
        samples: list[float] = []
        answered: list[float] = []
        before = trips = (await ask(control, "truth"))["watchdog_trips"]
        while len(samples) < n:
            (present, *_) = await client.call("GetRobotJoints", rpc.GetRobotJointsArgs(robot))
            target = targets[0] if present.value < home[0].value else targets[1]
            await client.call("MoveToJoints", rpc.MoveToJointsArgs(robot, 0.5, target))
            await client.next_event("RobotMoveToJoints")
            # Wait for motion, because control may have to be taken again and a stop before motion is not sent.
            until = time.monotonic() + START_TIMEOUT
            while not (await ask(control, "truth"))["moving"] and time.monotonic() < until:  # noqa: ASYNC110
                await asyncio.sleep(0.005)
            await asyncio.sleep(random.random() * 0.25)
            sent = time.monotonic()
            await client.call("StopAll")
            answered.append(time.monotonic() - sent)
            end = (await client.next_event("RobotMoveToJoints")).data
            arrived = [stop["t"] for stop in await ask(control, "stops") if stop["t"] >= sent]
            if arrived:
                samples.append(arrived[0] - sent)
                continue
            # On a busy machine the watchdog can end the motion first, if the control process gets no core in time.
            tripped = (await ask(control, "truth"))["watchdog_trips"]
            if tripped == trips:
                raise RuntimeError(f"A stop did not arrive at the controller, and the motion ended: {end.message}")
            trips = tripped
            await moved(client, robot, await client.call("GetRobotJoints", rpc.GetRobotJointsArgs(robot)))
        await client.call("StopScene")
        await scene_state(client, "stopped")
    note = f"median {median(samples) * 1e3:.1f} ms, worst {max(samples) * 1e3:.1f} ms"
    note += f"; response at standstill, after {median(answered) * 1e3:.0f} ms (median)"
    note += f"; {trips - before} motions ended earlier by the watchdog, not counted" if trips > before else ""
    report.add(Metric("stop_latency_p99_ms", percentile(samples, 99) * 1e3, n, note))


async def stream(report: Report, host: str) -> None:
    """Measure receiving the state for a minute in a separate process, as in the cell host."""
    command = (sys.executable, "-m", "benchmarks.receive_robot_states", host, str(STREAM_SECONDS))
    process = await asyncio.create_subprocess_exec(*command, stdout=asyncio.subprocess.PIPE)
    assert process.stdout is not None
    result = msgspec.json.decode(await process.stdout.read())
    await process.wait()
    received, missed = result["received"], result["missed"]
    report.add(Metric("ur_stream_lost", 100.0 * missed / (received + missed), received + missed, "by timestamps"))
    report.add(Metric("ur_stream_core_percent", 100.0 * result["cpu"] / result["seconds"], 1, "of the whole process"))


async def run(report: Report, directory: Path) -> None:
    """Measure everything in this group."""
    host = free_loopback_address()
    command = python_module("arcor2_fakes.ur", "--host", host, "--control", "127.0.0.1:0")
    fake = Child("robot", command, directory / "robot.log")
    try:
        addresses = await fake.start_json()
        await stop_latency(report, directory, host, addresses["control"])
        await stream(report, host)
        await hold_to_run.run(report, directory, host, addresses["control"])
    finally:
        await fake.stop()
