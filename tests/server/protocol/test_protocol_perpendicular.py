"""A tool is turned straight down."""

import math
from pathlib import Path
from typing import Any

import msgspec
import pytest

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_server.online.perpendicular import CHECKED_YAWS, DOWN, joint_change, yaw_of, yaws
from tests.server.protocol.in_process_server import open_stage, refused, until_event


@pytest.mark.parametrize("yaw", [-3.0, -0.5, 0.0, 0.25, 3.1])
def test_angles_start_with_the_nearest_and_cover_one_turn(yaw: float) -> None:
    tool = Orientation.from_rotation_vector(0, 0, yaw) * DOWN
    assert math.remainder(yaw_of(tool) - yaw, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    angles = yaws(yaw)
    assert angles[0] == yaw
    assert len({round(math.remainder(angle, 2 * math.pi), 6) for angle in angles}) == CHECKED_YAWS
    distances = [round(abs(angle - yaw), 9) for angle in angles]
    assert distances == sorted(distances)


def test_joint_change_counts_common_joints() -> None:
    before = [Joint("a", 1.0), Joint("b", -1.0), Joint("gripper", 5.0)]
    assert joint_change(before, [Joint("b", 1.0), Joint("a", 0.5)]) == pytest.approx(2.5)


async def test_a_tool_is_turned_down_with_the_smallest_change(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Arm", "DumbArm", "Part") as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        args: dict[str, Any] = {"robot_id": "x", "end_effector_id": "tip", "speed": 1.0}
        assert "No scene is open" in await refused(alice, "SetEefPerpendicularToWorld", **args)
        await stage.place(alice, arm="Arm", dumb="DumbArm", part="Part")
        arm = args["robot_id"] = stage.ids["arm"]
        assert "offline" in await refused(alice, "SetEefPerpendicularToWorld", **args)
        await stage.start(alice)
        assert "lock" in await refused(alice, "SetEefPerpendicularToWorld", **args)
        for name in ("arm", "dumb", "part"):
            await alice.lock(stage.ids[name])
        for name, reason in (("part", "not a robot"), ("dumb", "inverse kinematics")):
            assert reason in await refused(alice, "SetEefPerpendicularToWorld", **args | {"robot_id": stage.ids[name]})
        assert "one arm" in await refused(alice, "SetEefPerpendicularToWorld", **args, arm_id="left")
        assert "speed" in await refused(alice, "SetEefPerpendicularToWorld", **args | {"speed": 0.0})
        assert "no end effector" in await refused(
            alice, "SetEefPerpendicularToWorld", **args | {"end_effector_id": "claw"}
        )

        tilted = Orientation.from_rotation_vector(0.2, -0.1, 0.4) * DOWN

        async def put(pose: Pose) -> None:
            raw = {"end_effector_id": "tip", "target_pose": msgspec.to_builtins(pose), "speed": 1.0}
            await stage.services.online.call(arm, "move_to_pose", raw)

        await put(Pose(Position(0.3, 0.2, 0.1), tilted))
        bob.take()
        await alice.ask("SetEefPerpendicularToWorld", dry_run=True, **args)
        assert bob.events() == []
        await alice.ask("SetEefPerpendicularToWorld", **args)
        end = await until_event(bob, "RobotMoveToPose", move_event_type="end")
        assert [event["data"]["move_event_type"] for event in bob.events()] == ["start", "end"]
        target = msgspec.convert(end["target_pose"], Pose)
        assert target.position == Position(0.3, 0.2, 0.1)
        assert Position(0, 0, 1).rotated(target.orientation).distance_to(Position(0, 0, -1)) < 1e-9
        # The joints of this arm are position and rotation vector. No other angle of the circle changes them less.
        current = tilted.rotation_vector()
        change = _distance(current, target.orientation)
        assert change < 1.0
        for degree in range(360):
            other = Orientation.from_rotation_vector(0, 0, math.radians(degree)) * DOWN
            assert _distance(current, other) > change - 0.02
        assert not stage.services.online.moving

        # The caller holds the lock before and after.
        assert "lock" in await refused(bob, "SetEefPerpendicularToWorld", **args)
        await put(Pose(Position(0.3, 0.2, -0.1), tilted))
        assert "below the floor" in await refused(alice, "SetEefPerpendicularToWorld", **args)


def _distance(current: tuple[float, ...], orientation: Orientation) -> float:
    """Return the change of the arm's joints. A rotation has two vectors: the short one and the long one."""
    short = orientation.rotation_vector()
    long = tuple(value * (1 - 2 * math.pi / math.hypot(*short)) for value in short)
    return min(sum(abs(a - b) for a, b in zip(current, vector, strict=True)) for vector in (short, long))
