"""Kinematics from a robot's model: offline, and for robots that compute none themselves."""

import math
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import pytest_asyncio

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box, ObjectModel, ObjectTypeSource
from tests.server.protocol.devices import DUMB_ARM, PART
from tests.server.protocol.in_process_server import Actor, Stage, open_stage, refused

pytestmark = pytest.mark.asyncio(loop_scope="module")

BASE = Pose(Position(0.1, 0.2, 0.3), Orientation(0, 0, math.sin(0.3), math.cos(0.3)))
TARGET = BASE * Pose(Position(0.4, 0.2, 0.3), Orientation(1, 0, 0, 0))
CRATE = PART.replace("class Part", "class Crate")
FORWARD = """
    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        raise Arcor2NotImplemented("forward_kinematics")
"""


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def stage(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Stage]:
    directory: Path = tmp_path_factory.mktemp("kinematics")
    async with open_stage(directory, "Arm", "DumbArm", "TwoArms") as opened:
        crate = ObjectModel.of(Box("Crate", 0.3, 0.3, 0.3))
        await opened.services.types.add(ObjectTypeSource("Crate", CRATE.lstrip(), model=crate))
        alice = await opened.person("alice")
        await opened.place(alice, arm="Arm", dumb="DumbArm", two="TwoArms")
        await opened.add(alice, "ur", "UR5e", BASE, host="127.0.0.99")
        await solve(alice, opened.ids["ur"])  # starts the worker
        await opened.spare_host()  # now, so that the start does not count as part of some test
        opened.alice = alice  # type: ignore[attr-defined]
        yield opened


@pytest.fixture
def alice(stage: Stage) -> Actor:
    actor: Actor = stage.alice  # type: ignore[attr-defined]
    return actor


async def solve(alice: Actor, robot: str, pose: Pose = TARGET, **more: Any) -> list[dict[str, Any]]:
    args = {"robot_id": robot, "end_effector_id": "tcp", "pose": msgspec.to_builtins(pose)} | more
    found: list[dict[str, Any]] = await alice.ask("InverseKinematics", **args)
    return found


async def forward(alice: Actor, robot: str, joints: Any) -> Pose:
    found = await alice.ask("ForwardKinematics", robot_id=robot, end_effector_id="tcp", joints=joints)
    return msgspec.convert(found, Pose)


async def test_joints_are_computed_from_the_model_offline(stage: Stage, alice: Actor) -> None:
    robot = stage.ids["ur"]
    assert not stage.services.online.online
    joints = await solve(alice, robot)
    reached = await forward(alice, robot, joints)
    assert reached.position.distance_to(TARGET.position) < 1e-6
    assert reached.orientation.angle_to(TARGET.orientation) < 1e-4
    start = [joint | {"value": joint["value"] - 0.02} for joint in joints]
    near = await solve(alice, robot, start_joints=start)
    assert [joint["value"] for joint in near] == pytest.approx([joint["value"] for joint in joints], abs=1e-4)


async def test_scene_objects_are_obstacles_for_inverse_kinematics(stage: Stage, alice: Actor) -> None:
    robot = stage.ids["ur"]
    crate = await stage.add(alice, "crate", "Crate", Pose(TARGET.position))
    args = {"robot_id": robot, "end_effector_id": "tcp", "pose": msgspec.to_builtins(TARGET)}
    text = await refused(alice, "InverseKinematics", **args)
    assert "only in collision" in text
    assert "crate" in text
    assert crate not in text, "the message contains the id instead of the name"
    joints = await solve(alice, robot, avoid_collisions=False)
    await alice.ask("RemoveFromScene", id=crate)
    assert await solve(alice, robot) == joints


async def test_impossible_requests_are_refused(stage: Stage, alice: Actor) -> None:
    robot = stage.ids["ur"]
    pose = msgspec.to_builtins(TARGET)
    far = msgspec.to_builtins(Pose(Position(5, 0, 0)))
    assert "cannot reach" in await refused(alice, "InverseKinematics", robot_id=robot, end_effector_id="tcp", pose=far)
    assert "one arm" in await refused(
        alice, "InverseKinematics", robot_id=robot, end_effector_id="tcp", pose=pose, arm_id="left"
    )
    joints = [{"name": "elbow", "value": 1.0}]
    text = await refused(alice, "ForwardKinematics", robot_id=robot, end_effector_id="tcp", joints=joints)
    assert "missing" in text
    for name in ("two", "dumb"):
        # Without a model the device is needed.
        args = {"robot_id": stage.ids[name], "end_effector_id": "tip", "pose": pose}
        assert "offline" in await refused(alice, "InverseKinematics", **args)
    # An asset that is not a robot model is reported as such.
    args = {"robot_id": stage.ids["arm"], "end_effector_id": "tip", "pose": pose}
    assert "arm.zip" in await refused(alice, "InverseKinematics", **args)
    stranger = await stage.person()
    assert "not logged in" in await refused(stranger, "InverseKinematics", **args)


async def test_object_settings_change_its_model(stage: Stage, alice: Actor) -> None:
    short = await forward(alice, stage.ids["ur"], await solve(alice, stage.ids["ur"]))
    joints = await solve(alice, stage.ids["ur"])
    longer = await stage.add(alice, "longer", "UR5e", BASE, host="127.0.0.98", tcp_z=0.1)
    reached = await forward(alice, longer, joints)
    assert reached.position.distance_to(short.position) == pytest.approx(0.1, abs=1e-6)
    await alice.ask("RemoveFromScene", id=longer)


async def test_kinematics_are_computed_for_a_robot_without_its_own(stage: Stage, alice: Actor) -> None:
    """While the robot is online, joints near the given ones are computed from its model."""
    silent = DUMB_ARM.replace("class DumbArm", "class Silent").replace(
        "urdf_package_name = None", 'urdf_package_name = "ur5e.zip"'
    )
    silent += FORWARD
    await stage.services.types.add(ObjectTypeSource("Silent", silent.lstrip()))
    meta = stage.services.types.robot_meta("Silent")
    assert not meta.features.inverse_kinematics
    assert not meta.features.forward_kinematics
    robot = await stage.add(alice, "silent", "Silent", BASE)
    joints = await solve(alice, stage.ids["ur"])
    for name in ("ur", "arm", "two"):
        await alice.ask("RemoveFromScene", id=stage.ids[name])
    await stage.start(alice)
    try:
        assert stage.services.online.online
        found = await solve(alice, robot, start_joints=joints)
        assert [joint["value"] for joint in found] == pytest.approx([joint["value"] for joint in joints], abs=1e-4)
        reached = await forward(alice, robot, found)
        assert reached.position.distance_to(TARGET.position) < 1e-6
        args = {"robot_id": stage.ids["dumb"], "end_effector_id": "tip", "pose": msgspec.to_builtins(TARGET)}
        assert "no model" in await refused(alice, "InverseKinematics", **args)
    finally:
        await stage.stop(alice)
