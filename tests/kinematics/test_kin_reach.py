"""Reachability of poses, and how little is computed again after a change."""

import math

import numpy as np
import pytest

from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Box, Sphere
from arcor2_hw.messages import Message
from arcor2_hw.planning.reachability import Judgement, Reach, Reachability
from tests.kinematics.kin_robots import DOBOT, UR, ur

DOWN = Orientation(1.0, 0.0, 0.0, 0.0)
BASE = Pose(Position(1.0, 2.0, 0.5), Orientation.from_rotation_vector(0.0, 0.0, 0.7))


def down_at(x: float, y: float, z: float) -> Pose:
    return BASE * Pose(Position(x, y, z), DOWN)


@pytest.fixture
def world() -> CollisionWorld:
    made = CollisionWorld()
    made.add_robot("arm", ur(), BASE)
    return made


@pytest.fixture
def reach(world: CollisionWorld) -> Reachability:
    return Reachability(world, "arm", ur().arm("tcp"))


def test_every_reachability_result_has_a_name_and_reason(world: CollisionWorld, reach: Reachability) -> None:
    good, far, inside = down_at(0.5, 0.1, 0.3), down_at(1.4, 0.0, 0.3), down_at(0.02, 0.0, 0.3)
    stretched = ur().arm("tcp").pose(np.array((0.1, -0.5, 0.005, -1.0, -1.5, 0.0)))
    answers = reach.judge([good, far, inside, BASE * stretched])
    assert [each.reach for each in answers] == [
        Reach.REACHABLE,
        Reach.OUT_OF_REACH,
        Reach.OUT_OF_REACH,
        Reach.NEAR_LIMIT,
    ]
    assert np.allclose((BASE * ur().arm("tcp").pose(np.array(answers[0].joints))).matrix(), good.matrix(), atol=1e-5)
    assert answers[0].reason is None
    assert "1.4" in str(answers[1].reason)
    assert "orientation" in str(answers[2].reason)
    assert "singular" in str(answers[3].reason)
    world.put("box", Box(0.1, 0.1, 0.1), good)
    (hit,) = reach.judge([good])
    assert hit.reach is Reach.IN_COLLISION
    contact = Message.of("{first} and {second}", first="arm/wrist_3_link", second="box")
    assert hit.reason == Message.of("Reached only in collision: {contact}.", contact=contact)
    assert hit.joints


def test_a_joint_near_its_limit_is_named() -> None:
    model = RobotModel.load(DOBOT)
    world = CollisionWorld()
    world.add_robot("dobot", model, Pose())
    reach = Reachability(world, "dobot", model.arm("tcp"))
    arm = model.arm("tcp")
    good, near = (arm.pose(np.array(q)) for q in ((0.2, 0.6, 0.5, 0.1), (0.2, 0.6, 0.5, math.radians(89.0))))
    answers = reach.judge([good, near])
    assert [each.reach for each in answers] == [Reach.REACHABLE, Reach.NEAR_LIMIT]
    assert answers[1].reason == Message.of("{joint} would be near its limit.", joint="joint_4")


def test_only_changed_poses_are_computed_again(world: CollisionWorld, reach: Reachability) -> None:
    chance = np.random.default_rng(1)
    poses = [down_at(*map(float, chance.uniform((0.3, -0.5, 0.1), (0.6, 0.5, 0.4)))) for _ in range(60)]
    first = reach.judge(poses)
    assert (reach.computed, reach.checked) == (60, 60)
    assert reach.judge(poses) == first
    assert (reach.computed, reach.checked) == (60, 60)
    # An obstacle far away: nothing is computed again.
    world.put("far", Box(0.5, 0.5, 0.5), down_at(5.0, 0.0, 0.0))
    assert reach.judge(poses) == first
    assert (reach.computed, reach.checked) == (60, 60)
    # An obstacle at some points: these are checked again, without a new search for joint values.
    world.put("near", Box(0.05, 0.05, 0.05), poses[0])
    again = reach.judge(poses)
    assert again[0].reach is Reach.IN_COLLISION
    assert reach.computed == 60
    assert 60 < reach.checked < 120
    checked = reach.checked
    world.delete("near")
    assert [each.reach for each in reach.judge(poses)] == [each.reach for each in first]
    assert reach.checked > checked
    # One more pose needs one more computation.
    computed = reach.computed
    reach.judge([*poses, down_at(0.4, 0.0, 0.33)])
    assert reach.computed == computed + 1


def test_results_after_changes_match_a_fresh_computation(world: CollisionWorld, reach: Reachability) -> None:
    chance = np.random.default_rng(2)
    poses = [down_at(*map(float, chance.uniform((-0.8, -0.8, 0.0), (0.8, 0.8, 0.6)))) for _ in range(80)]
    reach.judge(poses)

    def fresh() -> list[Judgement]:
        return Reachability(world, "arm", ur().arm("tcp")).judge(poses)

    names = [f"body {number}" for number in range(12)]
    for step in range(40):
        name = names[int(chance.integers(len(names)))]
        place = down_at(*map(float, chance.uniform((-0.8, -0.8, 0.0), (0.8, 0.8, 0.6))))
        if name in world.ids() and step % 3 == 0:
            world.delete(name)
        elif name in world.ids() and step % 3 == 1:
            world.move(name, place)
        else:
            world.put(name, [Sphere(0.05), Box(0.15, 0.05, 0.05)][step % 2], place)
        if step % 8 == 7:
            assert [each.reach for each in reach.judge(poses)] == [each.reach for each in fresh()]
    assert reach.computed == 80
    tip = BASE * Pose.from_matrix(ur().link_poses(world.robot("arm").q)["flange"])
    world.put("tool", Box(0.05, 0.02, 0.1), tip * Pose(Position(0.0, 0.0, 0.06)))
    world.attach("tool", "arm", "flange")
    assert [each.reach for each in reach.judge(poses)] == [each.reach for each in fresh()]
    assert reach.computed == 80
    world.allow("tool", names[0])
    assert [each.reach for each in reach.judge(poses)] == [each.reach for each in fresh()]
    world.move_robot("arm", BASE * Pose(Position(0.1, 0.0, 0.0)))
    moved = reach.judge(poses)
    assert reach.computed == 160
    assert [each.reach for each in moved] == [each.reach for each in fresh()]
    assert {each.reach for each in moved} >= {Reach.REACHABLE, Reach.IN_COLLISION, Reach.OUT_OF_REACH}


def test_a_tool_extends_the_reach() -> None:
    far = Pose(Position(1.05, 0.0, 0.2), Orientation.from_rotation_vector(0.0, math.pi / 2.0, 0.0))
    answers = []
    for tcp in (0.0, 0.3):
        model = RobotModel.load(UR / "ur5e", {"tcp_z": tcp})
        world = CollisionWorld()
        world.add_robot("arm", model, Pose())
        answers += Reachability(world, "arm", model.arm("tcp")).judge([far])
    assert [each.reach for each in answers] == [Reach.OUT_OF_REACH, Reach.REACHABLE]
