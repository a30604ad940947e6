"""Per-robot kinematic calibration from the controller: stored, used offline and after a restart, and announced."""

from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import msgspec
import numpy as np
import pytest
import pytest_asyncio

import arcor2_drivers
from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.robot import Joint
from arcor2_hw.kinematics.dh import DhRow, calibrated
from arcor2_hw.kinematics.model import RobotModel
from tests.e2e.harness import Cell, scene_state

pytestmark = pytest.mark.asyncio(loop_scope="module")

MODEL = RobotModel.load(Path(next(iter(arcor2_drivers.__path__))) / "universal_robots" / "urdf" / "ur5e")
Q = (0.4, -1.3, 1.1, 0.2, -0.7, 2.0)
NOMINAL_D = (0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996)
NOMINAL_A = (0.0, -0.425, -0.3922, 0.0, 0.0, 0.0)
NOMINAL_ALPHA = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
DELTAS = np.random.default_rng(7).uniform(-1e-3, 1e-3, (4, 6))
"""Offsets that the calibration of the arm adds to theta, a, d and alpha."""


def tip(deltas: Any = None) -> Position:
    """Return the tip's position at the joints Q, nominal or with the given offsets."""
    model = MODEL
    if deltas is not None:
        theta, a, d, alpha = deltas
        rows = zip(theta, NOMINAL_D + d, NOMINAL_A + a, NOMINAL_ALPHA + alpha, strict=True)
        model = calibrated(MODEL, "tcp", [DhRow(*map(float, row)) for row in rows])
    return model.arm("tcp").pose(np.array(Q)).position


@dataclass
class Workplace:
    cell: Cell
    client: Client
    robot: str

    async def robot_kinematics(self) -> dict[str, Any]:
        async with httpx.AsyncClient(timeout=60, base_url=self.cell.url.replace("ws", "http", 1)) as http:
            answer = await http.get(f"/api/robots/{self.robot}/kinematics")
            assert answer.status_code == 200, answer.text
            found: dict[str, Any] = answer.json()
            return found

    async def offline_tip(self) -> Position:
        """Return the tip's position at the joints Q as the server computes it offline."""
        names = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
        joints = [Joint(f"{name}_joint", value) for name, value in zip(names, Q, strict=True)]
        args = rpc.ForwardKinematicsArgs(self.robot, "tcp", joints)
        pose: Pose = await self.client.call("ForwardKinematics", args)
        return pose.position

    async def go_online(self) -> str:
        """Start and stop the scene. Return the notification about the robot's kinematics."""
        await self.client.call("StartScene")
        await scene_state(self.client, SceneStateEnum.STARTED)
        message: str = (await self.client.next_event("Notification", timeout=20)).data.message
        await self.go_offline()
        return message

    async def go_offline(self) -> None:
        await self.client.call("StopScene")
        await scene_state(self.client, SceneStateEnum.STOPPED)

    async def set_host(self, host: str, *more: Parameter) -> None:
        parameters = [Parameter("host", "string", msgspec.json.encode(host).decode()), *more]
        await self.client.call("WriteLock", rpc.WriteLockArgs(self.robot))
        await self.client.call("UpdateObjectParameters", rpc.UpdateObjectParametersArgs(self.robot, parameters))
        await self.client.call("WriteUnlock", rpc.WriteUnlockArgs(self.robot))


@pytest_asyncio.fixture(loop_scope="module")
async def workplace(tmp_path: Path) -> AsyncIterator[Workplace]:
    """Start a server for each test, because one test ends it."""
    cell = Cell(tmp_path)
    try:
        await cell.start_robot()
        await cell.command_fake("robot", "calibration", deltas=DELTAS.tolist())
        await cell.start_server()
        client = await cell.client("alice")
        await client.call("NewScene", rpc.NewSceneArgs("arm"))
        parameters = [Parameter("host", "string", msgspec.json.encode(cell.robot_host).decode())]
        await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs("arm", "UR5e", Pose(), parameters))
        robot = (await client.next_event("SceneObjectChanged", timeout=60)).data.id
        yield Workplace(cell, client, robot)
    finally:
        await cell.stop()


async def test_calibration_from_the_controller_is_used_offline_and_after_a_restart(
    workplace: Workplace,
) -> None:
    kinematics = await workplace.robot_kinematics()
    assert (kinematics["in_force"], "read" in kinematics) == ("nominal", False)
    assert (await workplace.offline_tip()).distance_to(tip()) < 1e-6
    assert tip().distance_to(tip(DELTAS)) > 1e-3, "the calibration must make a difference"

    message = await workplace.go_online()
    assert message.startswith("arm: The calibration in the controller is now used")
    kinematics = await workplace.robot_kinematics()
    assert kinematics["in_force"] == "measured"
    assert len(kinematics["checksum"].split("-")) == 6
    assert kinematics["read"]
    assert (await workplace.offline_tip()).distance_to(tip(DELTAS)) < 1e-6

    await workplace.client.call("SaveScene")
    port = int(workplace.cell.url.rpartition(":")[2].rstrip("/"))
    await workplace.cell.kill("server")
    await workplace.cell.start_server(port)
    workplace.client = await workplace.cell.client("bob")
    assert (await workplace.offline_tip()).distance_to(tip(DELTAS)) < 1e-6

    # The calibration is not used for a robot with another address.
    await workplace.set_host("127.99.0.7")
    assert (await workplace.robot_kinematics())["in_force"] == "nominal"
    assert (await workplace.offline_tip()).distance_to(tip()) < 1e-6
    await workplace.set_host(workplace.cell.robot_host)
    assert (await workplace.robot_kinematics())["in_force"] == "measured"


async def test_safe_moves_avoid_bodies_added_by_rest_and_the_gripped_part(workplace: Workplace) -> None:
    client, robot = workplace.client, workplace.robot
    await workplace.set_host(workplace.cell.robot_host, Parameter("payload_mass", "double", "0.0"))
    await workplace.cell.command_fake("robot", "place", q=[0.4, -1.3, 1.5, -1.77, -1.57, 0.3])
    await client.call("StartScene")
    await scene_state(client, SceneStateEnum.STARTED)
    tip = await client.get_end_effector_pose(robot_id=robot, end_effector_id="tcp")

    async def line(by: Position) -> str:
        """Move the tip in a line; return the reason of a refusal."""
        await client.move_to_pose(
            robot_id=robot,
            end_effector_id="tcp",
            speed=0.5,
            position=tip.position + by,
            orientation=tip.orientation,
            linear=True,
        )
        while (motion := (await client.next_event("RobotMoveToPose", timeout=20)).data).move_event_type == "start":
            pass
        return motion.message if motion.move_event_type == "failed" else ""

    async with httpx.AsyncClient(timeout=60, base_url=workplace.cell.url.replace("ws", "http", 1)) as http:

        async def put(key: str, at: Position, x: float, y: float, z: float) -> None:
            size = {"boxId": key, "sizeX": x, "sizeY": y, "sizeZ": z}
            answer = await http.put("/collisions/box", params=size, json={"position": msgspec.to_builtins(at)})
            assert answer.status_code == 200, answer.text

        up, back = Position(0.0, 0.0, 0.1), Position()
        assert await line(up) == ""
        await put("crate", tip.position, 0.1, 0.1, 0.1)
        assert "crate" in await line(back)
        assert (await http.delete("/collisions/crate")).status_code == 200
        # The gripped rod would touch the table. The robot without the rod does not.
        await put("table", tip.position - Position(0.0, 0.0, 0.27), 0.4, 0.4, 0.02)
        assert await line(back) == ""
        assert await line(up) == ""
        await put("rod", tip.position + up - Position(0.0, 0.0, 0.15), 0.03, 0.03, 0.26)
        answer = await http.put("/collisions/rod/attach", params={"robotId": robot, "link": "tcp"})
        assert answer.status_code == 200, answer.text
        refusal = await line(back)
        assert "rod" in refusal
        assert "table" in refusal
        assert await line(up + Position(0.0, 0.05, 0.0)) == "", "the gripped rod is not an obstacle for its own robot"
        assert (await http.delete("/collisions/rod")).status_code == 200
        assert await line(back) == ""
    await workplace.go_offline()


async def test_calibration_of_another_arm_is_not_used(workplace: Workplace) -> None:
    await workplace.go_online()
    assert (await workplace.robot_kinematics())["in_force"] == "measured"
    await workplace.cell.command_fake("robot", "calibration", deltas=DELTAS.tolist(), reported=False)
    message = await workplace.go_online()
    assert "The calibration cannot be read from the controller. The stored one is used." in message
    assert workplace.cell.robot_host in message
    assert (await workplace.offline_tip()).distance_to(tip(DELTAS)) < 1e-6

    strange = DELTAS.copy()
    strange[2, 0] += 0.2
    await workplace.cell.command_fake("robot", "calibration", deltas=strange.tolist())
    message = await workplace.go_online()
    assert "arm: The calibration in the controller cannot be used. Kinematics are nominal." in message
    kinematics = await workplace.robot_kinematics()
    assert kinematics["in_force"] == "nominal"
    assert "50 mm" in kinematics["refused"]
    assert (await workplace.offline_tip()).distance_to(tip()) < 1e-6

    await workplace.cell.command_fake("robot", "calibration", deltas=DELTAS.tolist())
    await workplace.go_online()
    assert (await workplace.offline_tip()).distance_to(tip(DELTAS)) < 1e-6
