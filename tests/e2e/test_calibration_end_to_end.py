"""A server with a fake camera and robot calibrates their poses, and refuses if the markers or the arm are hidden."""

import asyncio
import contextlib
import os
import signal
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import msgspec
import psutil
import pytest
import pytest_asyncio

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.parameter import Parameter
from arcor2_server.cli.main import app
from arcor2_server.demo.fakes import free_loopback_address
from tests import forked_children
from tests.e2e.harness import scene_state, until
from tests.e2e.workplace_with_camera import (
    CAMERA,
    MARKERS,
    ROBOT,
    SIZE,
    Q,
    pose,
    pose_error,
    rotated_about_z,
    visible_things,
)
from tests.fakes.conftest import FakeProcess
from tests.server.core.serving import ServerProcess

pytestmark = pytest.mark.asyncio(loop_scope="module")


class World:
    """Fakes, server, and a client that has locked the scene."""

    def __init__(self, directory: Path) -> None:
        self.host = free_loopback_address()
        self.camera = FakeProcess("oak_d", "--width", "1280", "--height", "720", "--fps", "5")
        self.robot = FakeProcess("ur", "--host", self.host, "--time-scale", "0.1")
        self.server = ServerProcess(directory / "data")
        self.ids: dict[str, str] = {}
        self._exit = contextlib.AsyncExitStack()

    async def start(self) -> None:
        self._exit.callback(self.camera.end)
        self._exit.callback(self.robot.end)
        self.robot.control.do("place", q=Q)
        self.show()
        await self.server.start()
        self._exit.push_async_callback(self.server.stop)
        client = self.client = await self._exit.enter_async_context(Client(self.server.url, "alice", reconnect=False))
        await client.new_scene("scene")
        near = Pose(CAMERA.position + Position(0.1, -0.05, 0.08), CAMERA.orientation)
        wrong = Pose(ROBOT.position + Position(0.02, -0.015, 0.01), ROBOT.orientation * rotated_about_z(0.03))
        await client.add_object_to_scene(
            name="cam",
            type="OakD",
            pose=near,
            parameters=[
                setting("address", self.camera.ready["stream"]),
                # A busy machine renders slowly.
                setting("max_age", 5.0),
                setting("frame_timeout", 10.0),
            ],
        )
        await client.add_object_to_scene(name="arm", type="UR5e", pose=wrong, parameters=[setting("host", self.host)])
        self.assumed = {"cam": near, "arm": wrong}
        base = self.server.url.replace("ws", "http", 1)
        self.http = await self._exit.enter_async_context(
            httpx.AsyncClient(base_url=base, timeout=60.0, limits=httpx.Limits(max_keepalive_connections=0))
        )
        async with Client(self.server.url) as other:
            scene = (await other.next_event("OpenScene")).data.scene
        self.ids = {obj.name: obj.id for obj in scene.objects}
        await client.start_scene()
        await scene_state(client, SceneStateEnum.STARTED)
        await client.subscribe_events({"TaskState"})

    def show(self, *, markers: bool = True, robot: bool = True) -> None:
        """Send the objects of the workplace to the fake camera."""
        self.camera.control.do("scene", things=visible_things(markers=markers, robot=robot))
        self.camera.control.do("camera", pose=pose(CAMERA))

    async def configure_markers(self) -> None:
        """Store the poses of the markers on the server."""
        markers = [{"marker_id": n, "pose": {"position": {"x": x, "y": y}}} for n, (x, y) in MARKERS.items()]
        answer = await self.http.put("/api/calibration/markers", json={"marker_size": SIZE, "markers": markers})
        assert answer.status_code == 200, answer.text

    async def stop(self) -> None:
        await self._exit.aclose()

    @contextlib.asynccontextmanager
    async def locked(self, name: str) -> AsyncIterator[None]:
        """Hold the lock of an object in this context."""
        await self.client.write_lock(self.ids[name])
        try:
            yield
        finally:
            await self.client.write_unlock(self.ids[name])

    async def calibrate(self, name: str, **more: Any) -> tuple[str, str]:
        """Calibrate; return the last state of the process and its message."""
        if name == "cam":
            await self.client.calibrate_camera(self.ids["cam"])
        else:
            await self.client.calibrate_robot(self.ids["arm"], move_to_calibration_pose=False, **more)
        while True:
            event = await self.client.next_event("ProcessState", timeout=60.0)
            if event.data.state != "started":
                return event.data.state, event.data.message

    async def stored_pose(self, name: str) -> Pose:
        async with Client(self.server.url) as other:
            scene = (await other.next_event("OpenScene")).data.scene
        (found,) = [obj.pose for obj in scene.objects if obj.name == name]
        return found

    def workers(self) -> list[psutil.Process]:
        return forked_children.children(self.server.process.pid, "arcor2_hw.compute")


def setting(name: str, value: str | float) -> Parameter:
    return Parameter(name, "string" if isinstance(value, str) else "double", msgspec.json.encode(value).decode())


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def world(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[World]:
    running = World(tmp_path_factory.mktemp("calibration"))
    try:
        await running.start()
        yield running
    finally:
        await running.stop()


async def test_camera_pose_is_calibrated_from_markers(world: World) -> None:
    async with world.locked("cam"):
        state, message = await world.calibrate("cam")
        assert state == "failed"
        assert "No markers are configured" in message
        await world.configure_markers()
        state, message = await world.calibrate("cam")
        assert state == "finished", message
        millimetres, degrees = pose_error(await world.stored_pose("cam"), CAMERA)
        assert millimetres < 3.0
        assert degrees < 0.2
        (record, *_) = (await world.http.get("/api/calibrations", params={"object_id": world.ids["cam"]})).json()
        assert (record["person"], record["kind"], record["verdict"]) == ("alice", "camera_pose", message)
        assert len(record["inputs"]) == 3


async def test_robot_pose_is_calibrated_from_depth(world: World) -> None:
    async with world.locked("arm"):
        before = pose_error(await world.stored_pose("arm"), ROBOT)
        assert before[0] > 20.0
        state, message = await world.calibrate("arm")
        assert state == "finished", message
        millimetres, degrees = pose_error(await world.stored_pose("arm"), ROBOT)
        assert millimetres < 2.5
        assert degrees < 0.2
        assert message.startswith("arm is ")
        (record, *_) = (await world.http.get("/api/calibrations", params={"object_id": world.ids["arm"]})).json()
        assert record["kind"] == "robot_pose"
        assert record["parameters"]["camera_name"] == "cam"


async def test_calibration_is_refused_if_markers_or_robot_are_hidden(world: World) -> None:
    await world.configure_markers()
    for name, hidden, words in (
        ("cam", {"markers": False}, "No configured marker"),
        ("arm", {"robot": False}, "robot"),
    ):
        async with world.locked(name):
            before = await world.stored_pose(name)
            records = (await world.http.get("/api/calibrations")).json()
            world.show(**hidden)
            await asyncio.sleep(0.5)  # a picture taken earlier may still arrive
            try:
                state, message = await world.calibrate(name)
            finally:
                world.show()
            assert state == "failed", message
            assert words in message
            assert await world.stored_pose(name) == before
            assert (await world.http.get("/api/calibrations")).json() == records


async def test_a_killed_worker_fails_only_the_running_calibration(world: World) -> None:
    client = world.client
    async with world.locked("arm"):
        for worker in world.workers():
            worker.kill()
        await client.calibrate_robot(world.ids["arm"], move_to_calibration_pose=False)
        while True:
            event = await client.next_event("TaskState", timeout=60.0)
            if event.data.message == "searching for the robot":
                break
        for worker in world.workers():
            os.kill(worker.pid, signal.SIGKILL)
        while (event := await client.next_event("ProcessState", timeout=60.0)).data.state == "started":
            pass
        assert event.data.state == "failed"
        assert "compute worker was killed by SIGKILL while it worked on the pose of a robot" in event.data.message
    # The next calibration uses another worker.
    async with world.locked("cam"):
        state, message = await world.calibrate("cam")
        assert state == "finished", message


async def test_a_gripped_part_is_an_obstacle_at_the_robots_pose(world: World) -> None:
    http, arm_id = world.http, world.ids["arm"]
    joints = await world.client.get_robot_joints(arm_id)
    tip = await world.client.get_end_effector_pose(robot_id=arm_id, end_effector_id="tcp")
    part = {"position": msgspec.to_builtins(tip.position)}
    size = {"boxId": "part", "sizeX": 0.04, "sizeY": 0.04, "sizeZ": 0.04}
    assert (await http.put("/collisions/box", params=size, json=part)).status_code == 200

    async def check_line(at: Position) -> Any:
        ends = {"pt1": msgspec.to_builtins(at + Position(0, 0, 0.5)), "pt2": msgspec.to_builtins(at)}
        return (await http.put("/utils/line-safe", json=ends)).json()

    assert await check_line(tip.position) == {"safe": False, "object_id": "part"}
    holder = {"robotId": arm_id, "link": "tcp"}
    answer = await http.put("/collisions/part/attach", params=holder)
    assert answer.status_code == 200, answer.text
    assert (await http.put("/collisions/part/attach", params=holder)).status_code == 409
    assert await check_line(tip.position) == {"safe": False, "object_id": "part"}
    world.robot.control.do("place", q=[joints[0].value + 0.6, *(joint.value for joint in joints[1:])])
    moved = await until(lambda: _moved(world, tip), "the arm is at another position")
    assert await check_line(tip.position) == {"safe": True}
    assert await check_line(moved.position) == {"safe": False, "object_id": "part"}
    answer = await http.put("/collisions/part/detach")
    assert answer.status_code == 200, answer.text
    released = msgspec.convert(answer.json(), Pose)
    assert released.position.distance_to(moved.position) < 0.005
    world.robot.control.do("place", q=Q)
    await until(lambda: _moved(world, moved), "the arm has returned")
    assert await check_line(moved.position) == {"safe": False, "object_id": "part"}
    assert (await http.put("/collisions/part/detach")).status_code == 409
    assert (await http.delete("/collisions/part")).status_code == 200


async def _moved(world: World, before: Pose) -> Pose | None:
    now = await world.client.get_end_effector_pose(robot_id=world.ids["arm"], end_effector_id="tcp")
    return now if now.position.distance_to(before.position) > 0.1 else None


async def test_the_command_line_calibrates_and_lists_the_records(
    world: World, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["calibrate", "online", "camera", "cam", "--url", world.server.url]
    status = await asyncio.to_thread(app, arguments)
    printed = capsys.readouterr()
    assert status == 0, printed
    assert "known to" in printed.out
    assert "position" in printed.out
    await asyncio.to_thread(app, ["calibrate", "online", "records", "cam", "--url", world.server.url])
    assert "camera_pose" in capsys.readouterr().out
    with pytest.raises(RequestFailed):
        await world.client.calibrate_camera(world.ids["arm"])
    assert await asyncio.to_thread(app, [*arguments[:3], "nose", "--url", world.server.url]) == 9
    assert "no object 'nose'" in capsys.readouterr().err
