"""Tests of the kinematics worker: sending the world, also after a restart, and its tasks."""

import asyncio
import math
import os
import signal
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio

import arcor2_drivers.universal_robots
from arcor2_hw.collision.description import (
    Attachment,
    MeshShape,
    RobotSource,
    StoredFile,
    WorldBody,
    WorldItem,
    WorldRobot,
)
from arcor2_hw.compute import kinematics_tasks as t, messages as m
from arcor2_hw.compute.task import ComputeStopped, WorkerKind
from arcor2_hw.data.editor import Reach
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import InvalidData, KinematicsError, NotFound
from arcor2_hw.kinematics.primitives import Box, Cylinder, Sphere
from arcor2_server.compute.process import ComputeProcess
from arcor2_server.compute.workers import Compute

UR5E = StoredFile(str(Path(arcor2_drivers.universal_robots.__path__[0]) / "urdf" / "ur5e"), "ur5e")
DOWN = Orientation(1, 0, 0, 0)


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def compute() -> AsyncIterator[Compute]:
    created = Compute(idle=60.0)
    await created.run(t.DescribeRobot(RobotSource(UR5E)))
    yield created
    await created.close()


pytestmark = pytest.mark.asyncio(loop_scope="module")


def robot(base: Pose | None = None, joints: list[Joint] | None = None) -> WorldRobot:
    return WorldRobot("arm", RobotSource(UR5E, base or Pose()), joints or [])


def world(*things: WorldItem) -> dict[str, WorldItem]:
    return {thing.id: thing for thing in things}


def box(key: str, x: float, y: float, z: float, *size: float, attachment: Attachment | None = None) -> WorldBody:
    return WorldBody(key, Box(size[0], size[1], size[2]), Pose(Position(x, y, z)), attachment)


async def forward(compute: Compute, joints: list[Joint], base: Pose | None = None) -> Pose:
    return await compute.run(t.SolveForward(RobotSource(UR5E, base or Pose()), "tcp", joints))


# ------------------------------------------------------------------------------------------------ robots
async def test_forward_and_inverse_kinematics_agree(compute: Compute) -> None:
    base = Pose(Position(0.5, -0.2, 0.7), Orientation(0, 0, math.sin(0.4), math.cos(0.4)))
    target = base * Pose(Position(0.4, 0.2, 0.3), DOWN)
    solve = t.SolveInverse("arm", "tcp", target)
    joints = await compute.run(solve, world=world(robot(base)))
    reached = await forward(compute, joints, base)
    assert reached.position.distance_to(target.position) < 1e-6
    assert reached.orientation.angle_to(target.orientation) < 1e-5
    # Close to the start there are other joint values that reach the same pose.
    start = [Joint(joint.name, joint.value + 0.05) for joint in joints]
    near = await compute.run(t.SolveInverse("arm", "tcp", target, start), world=world(robot(base)))
    assert [joint.value for joint in near] == pytest.approx([joint.value for joint in joints], abs=1e-5)


async def test_an_unreachable_pose_is_refused_with_the_reason(compute: Compute) -> None:
    far = t.SolveInverse("arm", "tcp", Pose(Position(3, 0, 0), DOWN))
    with pytest.raises(KinematicsError, match="cannot reach") as raised:
        await compute.run(far, world=world(robot()))
    assert raised.value.code == "out_of_reach"
    target = Pose(Position(0.4, 0.2, 0.3), DOWN)
    around = box("crate", 0.4, 0.2, 0.3, 0.3, 0.3, 0.3)
    with pytest.raises(KinematicsError, match="crate") as raised:
        await compute.run(t.SolveInverse("arm", "tcp", target), world=world(robot(), around))
    assert raised.value.code == "in_collision"
    await compute.run(t.SolveInverse("arm", "tcp", target, avoid_collisions=False), world=world(robot(), around))
    # The only end effector may have a driver-specific name.
    joints = await joints_of(compute)
    assert await compute.run(t.SolveForward(RobotSource(UR5E), "gripper", joints)) == await forward(compute, joints)


async def joints_of(compute: Compute) -> list[Joint]:
    found = await compute.run(t.DescribeRobot(RobotSource(UR5E)))
    return [Joint(joint.name, 0.1) for joint in found.joints]


async def test_a_model_is_described(compute: Compute) -> None:
    found = await compute.run(t.DescribeRobot(RobotSource(UR5E)))
    assert (found.name, len(found.joints), found.end_effectors) == ("ur5e", 6, ["tcp"])
    assert all(joint.lower == -joint.upper for joint in found.joints[3:])  # type: ignore[operator]
    assert found.triangles > 100
    longer = await compute.run(
        t.SolveForward(RobotSource(UR5E, settings={"tcp_z": 0.1}), "tcp", [Joint(j.name, 0.0) for j in found.joints])
    )
    short = await forward(compute, [Joint(j.name, 0.0) for j in found.joints])
    assert longer.position.distance_to(short.position) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("name", "content", "code", "words"),
    [
        ("lost.urdf", b"", "robot_model", "XML"),
        ("mesh.urdf", b'<robot name="r"><link name="a"><visual><geometry><mesh filename="b.stl"/></geometry></visual>'
         b'</link><link name="b"/><joint name="j" type="revolute"><parent link="a"/><child link="b"/>'
         b'<limit lower="0" upper="1" velocity="1"/></joint></robot>', "missing_mesh", "b.stl"),
        ("loop.urdf", b'<robot name="r"><link name="a"/><link name="b"/>'
         b'<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>'
         b'<joint name="k" type="continuous"><parent link="b"/><child link="a"/></joint></robot>', "joint_loop", "j"),
        ("flat.urdf", b'<robot name="r"><link name="a">'
         b'<collision><geometry><box size="1 0 1"/></geometry></collision>'
         b'</link><link name="b"/>'
         b'<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>',
         "zero_length", "link a"),
        ("zip.zip", b"PK\x03\x04 no archive", "robot_model", "zip"),
    ],
)  # fmt: skip
async def test_an_unusable_model_is_refused_with_the_reason(
    compute: Compute, tmp_path: Path, name: str, content: bytes, code: str, words: str
) -> None:
    path = tmp_path / "content"
    path.write_bytes(content)
    model = RobotSource(StoredFile(str(path), name))
    with pytest.raises(InvalidData, match=words) as raised:
        await compute.run(t.DescribeRobot(model))
    assert raised.value.code == code
    with pytest.raises(InvalidData, match=words):
        await compute.run(t.JudgePoses("arm", "tcp", [Pose()]), world=world(WorldRobot("arm", model)))


# ------------------------------------------------------------------------------------------------ reachability
async def test_reachability_follows_changes_of_the_world(compute: Compute) -> None:
    poses = [Pose(Position(0.4, 0.2, 0.3), DOWN), Pose(Position(0.4, -0.4, 0.3), DOWN), Pose(Position(2, 0, 0), DOWN)]
    judge = t.JudgePoses("arm", "tcp", poses)
    crate = box("crate", 0.4, 0.2, 0.3, 0.2, 0.2, 0.2)

    async def reach(*things: WorldItem) -> list[Reach]:
        return [each.reach for each in await compute.run(judge, world=world(*things))]

    free, far = Reach.REACHABLE, Reach.OUT_OF_REACH
    assert await reach(robot()) == [free, free, far]
    assert await reach(robot(), crate) == [Reach.IN_COLLISION, free, far]
    assert await reach(robot(), box("crate", 0.4, -0.4, 0.3, 0.2, 0.2, 0.2)) == [free, Reach.IN_COLLISION, far]
    assert await reach(robot(Pose(Position(1.6, 0, 0)))) == [far, far, free]
    judged = await compute.run(judge, world=world(robot(), crate))
    assert "crate" in str(judged[0].reason)
    assert "reaches" in str(judged[2].reason)


async def test_joint_values_are_checked(compute: Compute) -> None:
    names = [joint.name for joint in await joints_of(compute)]

    def joints(*values: float) -> list[Joint]:
        return [Joint(name, value) for name, value in zip(names, values, strict=True)]

    up = joints(0, -1.2, 1.0, -1.4, -1.57, 0)
    configurations = [up, joints(0, -1.2, 1.0, -1.4, -1.57, 7.0), joints(0, -1.2, 3.1, -1.4, -1.57, 0), up[:3]]
    judge = t.JudgeJoints("arm", configurations)
    found = await compute.run(judge, world=world(robot()))
    assert found[0].reach is Reach.REACHABLE
    assert found[1].reach is Reach.OUT_OF_REACH
    assert names[5] in str(found[1].reason)
    assert found[2].reach in (Reach.IN_COLLISION, Reach.NEAR_LIMIT)
    assert found[3].reach is Reach.UNKNOWN
    reached = (await forward(compute, up)).position
    found = await compute.run(judge, world=world(robot(), box("crate", *reached, 0.1, 0.1, 0.1)))
    assert found[0].reach is Reach.IN_COLLISION


# ------------------------------------------------------------------------------------------------ the world
PYRAMID = b"""solid pyramid
""" + b"".join(
    b"facet normal 0 0 0\nouter loop\n%s\nendloop\nendfacet\n"
    % b"\n".join(b"vertex %d %d %d" % corner for corner in facet)
    for facet in (
        ((0, 0, 0), (0, 1, 0), (1, 0, 0)),
        ((0, 0, 0), (1, 0, 0), (0, 0, 1)),
        ((0, 0, 0), (0, 0, 1), (0, 1, 0)),
        ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    )
) + b"endsolid pyramid\n"  # fmt: skip


async def first_hit(compute: Compute, *things: WorldItem, ignore: tuple[str, ...] = ()) -> str | None:
    check = t.CheckLines([t.Line(Position(-2, 0.2, 0.2), Position(2, 0.2, 0.2))], ignore=list(ignore))
    (hit,) = await compute.run(check, world=world(*things))
    return None if hit is None else hit.id


async def test_lines_hit_bodies(compute: Compute, tmp_path: Path) -> None:
    stl = tmp_path / "content"
    stl.write_bytes(PYRAMID)
    mesh = WorldBody("tent", MeshShape(StoredFile(str(stl), "tent.stl")), Pose())
    ball = WorldBody("ball", Sphere(0.3), Pose(Position(-1.2, 0.2, 0.2)))
    can = WorldBody("can", Cylinder(0.1, 1.0), Pose(Position(-1.8, 0.2, 0.2)))
    assert await first_hit(compute) is None
    assert await first_hit(compute, mesh) == "tent"
    assert await first_hit(compute, mesh, ball) == "ball"
    assert await first_hit(compute, mesh, ball, can) == "can"
    assert await first_hit(compute, mesh, ball, can, ignore=("can", "ball")) == "tent"
    assert await first_hit(compute, ball, ignore=("ball",)) is None
    small = WorldBody("tent", MeshShape(StoredFile(str(stl), "tent.stl"), (0.1, 0.1, 0.1)), Pose())
    assert await first_hit(compute, small) is None
    facts = await compute.run(t.ReadMesh(StoredFile(str(stl), "tent.stl"), (2.0, 1.0, 1.0)))
    assert (facts.triangles, facts.size) == (4, (2.0, 1.0, 1.0))


async def test_an_unusable_mesh_is_named_until_it_is_removed(compute: Compute, tmp_path: Path) -> None:
    bad = tmp_path / "content"
    bad.write_bytes(PYRAMID.replace(b"vertex 1 0 0", b"vertex nan 0 0"))
    tent = WorldBody("tent", MeshShape(StoredFile(str(bad), "tent.stl")), Pose())
    for _ in range(2):
        with pytest.raises(InvalidData, match=r"tent\.stl") as raised:
            await first_hit(compute, tent)
        assert raised.value.code == "bad_mesh"
    assert await first_hit(compute) is None
    with pytest.raises(InvalidData, match=r"gone\.stl"):
        await first_hit(compute, WorldBody("gone", MeshShape(StoredFile(str(tmp_path / "gone"), "gone.stl")), Pose()))


async def test_a_gripped_part_moves_with_the_robot(compute: Compute) -> None:
    names = [joint.name for joint in await joints_of(compute)]
    joints = [Joint(name, value) for name, value in zip(names, (0.3, -1.2, 1.0, -1.4, -1.57, 0), strict=True)]
    at = await forward(compute, joints)
    model = RobotSource(UR5E)
    part = Pose(at.position + Position(0, 0, -0.1))
    in_link = await compute.run(t.PlaceInLink(model, joints, "tcp", part))
    held = WorldBody("part", Box(0.05, 0.05, 0.05), in_link, Attachment("arm", "tcp"))

    async def hit_body(joints: list[Joint]) -> str | None:
        where = (await forward(compute, joints)) * in_link
        away = Position(0, 0.04, 0)  # next to the arm itself
        check = t.CheckLines([t.Line(where.position + away, where.position)], ignore=["arm"])
        (hit,) = await compute.run(check, world=world(robot(joints=joints), held))
        return None if hit is None else hit.id

    assert await hit_body(joints) == "part"
    moved = [Joint(joint.name, joint.value + 0.4) for joint in joints]
    assert await hit_body(moved) == "part"
    # The robot is recreated with another tool: its gripped part is at the same pose on the same link.
    longer = WorldRobot("arm", RobotSource(UR5E, settings={"tcp_z": 0.2}), joints)
    check = t.CheckLines([t.Line(part.position + Position(0, 0.04, 0), part.position)], ignore=["arm"])
    assert await compute.run(check, world=world(longer, held)) == [None]
    assert await hit_body(joints) == "part"
    with pytest.raises(NotFound, match="attached to arm"):
        await compute.run(check, world=world(held))
    with pytest.raises(NotFound, match="no link 'nose'"):
        await compute.run(t.PlaceInLink(model, joints, "nose", part))


async def test_a_restarted_worker_receives_the_world_again() -> None:
    compute = Compute(idle=60.0)
    crate = box("crate", 0, 0.2, 0.2, 0.2, 0.2, 0.2)
    assert await first_hit(compute, crate, robot(Pose(Position(0, 3, 0)))) == "crate"
    pid = compute.pid(WorkerKind.KINEMATICS)
    assert pid is not None
    os.kill(pid, signal.SIGSTOP)
    task = asyncio.create_task(first_hit(compute, crate))
    await asyncio.sleep(0.05)
    os.kill(pid, signal.SIGKILL)
    with pytest.raises(ComputeStopped, match="the safety of a line"):
        await task
    assert await first_hit(compute, crate) == "crate"
    assert compute.pid(WorkerKind.KINEMATICS) not in (None, pid)
    await compute.close()


async def test_only_differences_of_a_large_world_are_sent(compute: Compute, monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[int] = []
    send = ComputeProcess._send

    async def count(worker: ComputeProcess, message: Any) -> None:
        if isinstance(message, m.ChangeWorld):
            sent.append(len(message.put))
        await send(worker, message)

    monkeypatch.setattr(ComputeProcess, "_send", count)
    things = [box(f"b{n}", n % 10 + 3.0, n // 10 % 10, n // 100, 0.2, 0.2, 0.2) for n in range(1000)]
    assert await first_hit(compute, *things) is None
    for number in range(20):
        things[number] = box(f"b{number}", number % 10 + 4.0, 50.0, 0.0, 0.2, 0.2, 0.2)
        assert await first_hit(compute, *things) is None
    assert sent == [1000] + [1] * 20
    assert await first_hit(compute) is None


async def test_a_mesh_of_two_gigabytes_is_refused_without_reading(compute: Compute, tmp_path: Path) -> None:
    huge = tmp_path / "content"
    with huge.open("wb") as file:
        file.truncate(2 * 1024**3)  # sparse: it uses no disk space
    with pytest.raises(InvalidData, match=r"huge\.stl") as raised:
        await compute.run(t.ReadMesh(StoredFile(str(huge), "huge.stl")))
    assert raised.value.code == "bad_mesh"
    with pytest.raises(InvalidData, match=r"huge\.zip") as raised:
        await compute.run(t.DescribeRobot(RobotSource(StoredFile(str(huge), "huge.zip"))))
    assert raised.value.code == "unsafe_description"
