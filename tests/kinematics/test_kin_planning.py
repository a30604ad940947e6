"""Plans: exact or refused, repeatable, through gaps, with gripped parts; verified by independent checks."""

import itertools

import numpy as np
import pytest

from arcor2_hw.collision.sweep import Sweep, travel_per_joint
from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import Cancelled, InvalidData
from arcor2_hw.kinematics.errors import GoalInCollision, NoPath, OnlyInCollision, OutOfReach, StartInCollision
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Array, Box, Sphere
from arcor2_hw.planning.planner import Planner
from tests.kinematics import kin_robots

READY = np.array((0.0, -1.57, 1.57, -1.57, -1.57, 0.0))
ACROSS = np.array((np.pi - 0.4, -1.57, 1.57, -1.57, -1.57, 0.0))


def world_of(
    model: RobotModel, **boxes: tuple[tuple[float, float, float], tuple[float, float, float]]
) -> CollisionWorld:
    world = CollisionWorld()
    world.add_robot("arm", model, Pose())
    for name, (at, sizes) in boxes.items():
        world.put(name, Box(*sizes), Pose(Position(*at)))
    return world


def planner(world: CollisionWorld, resolution: float = 0.01) -> Planner:
    return Planner(Sweep(world, "arm", world.robot("arm").model.arm("tcp"), resolution))


def assert_free(world: CollisionWorld, way: list[Array], step: float = 0.004) -> None:
    """Check every 4 mrad of the fastest joint: finer than the planner, and at other positions."""
    for a, b in itertools.pairwise(way):
        count = max(2, int(np.ceil(np.abs(b - a).max() / step)))
        for share in np.linspace(0.0, 1.0, count):
            assert world.is_free("arm", a + share * (b - a))


WALL = {"wall": ((0.0, 0.55, 0.5), (0.04, 0.5, 1.0)), "floor": ((0.0, 0.0, -0.12), (2.0, 2.0, 0.1))}


def test_a_plan_around_a_wall_is_repeatable() -> None:
    world = world_of(kin_robots.ur(), **WALL)
    way = planner(world).to_joints(READY, ACROSS)
    assert len(way) > 2
    assert np.array_equal(way[0], READY)
    assert np.allclose(way[-1], ACROSS)
    assert_free(world, way)
    arm = world.robot("arm").model.arm("tcp")
    assert all(arm.within(q) for q in way)
    again = planner(world).to_joints(READY, ACROSS)
    assert len(again) == len(way)
    assert all(np.array_equal(a, b) for a, b in zip(way, again, strict=True))
    other = planner(world).to_joints(READY, ACROSS, seed=1)
    assert not (len(other) == len(way) and all(np.array_equal(a, b) for a, b in zip(way, other, strict=True)))
    assert_free(world, other)


def test_a_free_path_is_straight() -> None:
    world = world_of(kin_robots.ur(), floor=WALL["floor"])
    assert len(planner(world).to_joints(READY, ACROSS)) == 2


def test_a_pose_is_planned_with_a_free_configuration() -> None:
    """The configuration nearest to the start ends in the wall; another one is free."""
    model = kin_robots.ur()
    arm = model.arm("tcp")
    world = world_of(model)
    goal = np.array((1.5, -0.7, 1.2, -1.9, -1.57, 0.0))
    elbow = model.link_poses(arm.whole(goal))["forearm_link"][:3, 3]
    world.put("ball", Sphere(0.12), Pose(Position(*map(float, elbow))))
    way = planner(world).to_pose(READY, arm.forward(goal))
    assert np.allclose(arm.forward(way[-1]), arm.forward(goal), atol=1e-5)
    assert np.abs(way[-1] - goal).max() > 0.3
    assert_free(world, way)


def test_plans_avoid_obstacles_with_the_gripped_part() -> None:
    """The straight path is free without the rod, and blocked with it."""
    model = kin_robots.ur()
    arm = model.arm("tcp")
    goal = READY + np.array((1.2, 0.0, 0.0, 0.0, 0.0, 0.0))
    middle = Pose.from_matrix(arm.forward(READY + np.array((0.6, 0.0, 0.0, 0.0, 0.0, 0.0)))).position
    world = world_of(model, post=((middle.x, middle.y, middle.z - 0.3), (0.06, 0.06, 0.1)))
    world.set_joints("arm", READY)
    free = planner(world)
    assert len(free.to_joints(READY, goal)) == 2
    tip = Pose.from_matrix(arm.forward(READY))
    world.put("rod", Box(0.03, 0.03, 0.3), Pose(tip.position + Position(0.0, 0.0, -0.17)))
    world.attach("rod", "arm", "tcp")
    way = planner(world).to_joints(READY, goal)
    assert len(way) > 2
    assert_free(world, way)


def test_impossible_plans_are_refused_with_the_reason() -> None:
    model = kin_robots.ur()
    arm = model.arm("tcp")
    tip = Pose.from_matrix(arm.forward(ACROSS)).position
    world = world_of(model, crate=((tip.x, tip.y, tip.z), (0.1, 0.1, 0.1)))
    with pytest.raises(GoalInCollision, match="crate"):
        planner(world).to_joints(READY, ACROSS)
    with pytest.raises(StartInCollision, match="crate"):
        planner(world).to_joints(ACROSS, READY)
    with pytest.raises(OnlyInCollision, match="crate"):
        planner(world).to_pose(READY, arm.forward(ACROSS))
    far = np.eye(4)
    far[0, 3] = 2.0
    with pytest.raises(OutOfReach):
        planner(world).to_pose(READY, far)
    with pytest.raises(InvalidData, match=r"cannot move there: elbow_joint .* limits"):
        planner(world).to_joints(READY, READY + np.array((0.0, 0.0, 5.0, 0.0, 0.0, 0.0)))
    for nonsense in (np.full(6, np.nan), np.zeros(5)):
        with pytest.raises(InvalidData):
            planner(world).to_joints(nonsense, READY)


def test_without_a_path_the_obstacle_is_named() -> None:
    """No link gets past the fence; an approximate planner would stop in front of it."""
    world = world_of(RobotModel.load(kin_robots.TWO_AXIS), fence=((0.17, 0.0, 0.0), (0.26, 0.006, 0.1)))
    start, goal = np.array((-1.2, 0.3)), np.array((1.2, -0.3))
    with pytest.raises(NoPath, match=r"within 0\.3 s; the direct path meets arm/link_\d and fence"):
        Planner(Sweep(world, "arm", world.robot("arm").model.arm("tcp"), 0.004), "mini").to_joints(
            start, goal, within=0.3
        )


def test_a_joint_slightly_beyond_its_limit_can_return() -> None:
    model = RobotModel.load(kin_robots.TWO_AXIS)
    world = world_of(model)
    beyond = np.array((model.upper[0] + 0.01, 0.3))
    way = planner(world).to_joints(beyond, np.array((1.0, 0.3)))
    assert np.array_equal(way[0], beyond)
    with pytest.raises(InvalidData, match="from there: joint_1"):
        planner(world).to_joints(beyond + np.array((0.2, 0.0)), np.array((1.0, 0.3)))


def test_planning_can_be_cancelled() -> None:
    world = world_of(kin_robots.ur(), **WALL)
    with pytest.raises(Cancelled):
        planner(world).to_joints(READY, ACROSS, stopped=lambda: True)


def test_robots_with_few_joints_and_linkages_are_planned() -> None:
    planar = world_of(RobotModel.load(kin_robots.TWO_AXIS), pin=((0.2, 0.0, 0.02), (0.02, 0.02, 0.04)))
    start, goal = np.array((-1.2, 0.3)), np.array((1.2, -0.3))
    way = Planner(Sweep(planar, "arm", planar.robot("arm").model.arm("tcp"), 0.004)).to_joints(start, goal)
    assert len(way) > 2
    assert_free(planar, way)
    dobot = world_of(RobotModel.load(kin_robots.DOBOT), box=((0.2, 0.0, -0.05), (0.06, 0.06, 0.2)))
    one, two = np.array((-0.9, 0.6, 0.9, 0.0)), np.array((0.9, 0.6, 0.9, 0.0))
    way = planner(dobot).to_joints(one, two)
    assert len(way) > 2
    assert_free(dobot, way)


@pytest.mark.parametrize("make", [kin_robots.ur, lambda: RobotModel.load(kin_robots.DOBOT)])
def test_levers_bound_the_travel_of_points(make: object) -> None:
    """The bounds are compared with the vertices of the links after small random motions."""
    model = make()  # type: ignore[operator]
    world = world_of(model)
    robot = world.robot("arm")
    bound = travel_per_joint(robot)
    chance = np.random.default_rng(3)
    corners = {each.link: [] for each in model.collision}
    for each in model.collision:
        from arcor2_hw.kinematics.shapes import triangles_of

        vertices = triangles_of(each.shape).vertices
        corners[each.link].append(vertices @ each.origin[:3, :3].T + each.origin[:3, 3])
    lower, upper = np.maximum(model.lower, -np.pi), np.minimum(model.upper, np.pi)
    most = 0.0
    for _ in range(60):
        q = chance.uniform(lower, upper)
        step = chance.normal(size=len(q)) * 1e-4
        before, after = model.link_poses(q), model.link_poses(q + step)
        for link, parts in corners.items():
            for points in parts:
                moved = points @ (after[link] - before[link])[:3, :3].T + (after[link] - before[link])[:3, 3]
                share = np.linalg.norm(moved, axis=1).max() / (bound @ np.abs(step))
                most = max(most, share)
    assert 0.2 < most <= 1.0


def test_a_thin_wire_between_two_configurations_is_found() -> None:
    """The wire is 4 mm thick, less than half the step; the margin of half a step makes sure it is found."""
    model = kin_robots.ur()
    arm = model.arm("tcp")
    goal = READY + np.array((1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    chance = np.random.default_rng(5)
    for _ in range(25):
        share = chance.uniform(0.1, 0.9)
        at = Pose.from_matrix(arm.forward(READY + share * (goal - READY))).position
        world = CollisionWorld(margin=0.005)
        world.add_robot("arm", model, Pose())
        world.put("wire", Box(0.002, 0.002, 0.3), Pose(at + Position(0.0, 0.0, -0.1), Orientation()))
        sweep = Sweep(world, "arm", arm, 0.01)
        hit = sweep.first_hit([READY, goal])
        assert hit is not None
        assert "wire" in hit.what
        assert abs(hit.share - share) < 0.15
        assert not sweep.is_free_at_full_resolution(READY, goal)
        assert not sweep.is_free_between(READY, goal)
