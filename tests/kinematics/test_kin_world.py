"""The collision world: contacts by name, gripped parts, lines, and a thousand bodies."""

import math
import time

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings, strategies as st

from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.data import object_type
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import Conflict, InvalidData, NotFound
from arcor2_hw.kinematics.errors import BadMesh, ZeroLength
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import (
    Box,
    Capsule,
    Cylinder,
    Hull,
    Shape,
    Sphere,
    TriangleMesh,
    extent,
    hull_of,
    of_model,
    triangles_of,
)
from tests.kinematics.kin_robots import UR, joint, links, ur, urdf

HOME = np.array((0.0, -1.2, 1.4, -1.8, -1.5, 0.0))


def at(x: float, y: float, z: float) -> Pose:
    return Pose(Position(x, y, z))


def pairs(world: CollisionWorld, q: np.ndarray = HOME, robot: str = "arm") -> set[tuple[str, str]]:
    return {(each.first, each.second) for each in world.contacts(robot, q)}


@pytest.fixture
def world() -> CollisionWorld:
    made = CollisionWorld()
    made.add_robot("arm", ur(), Pose(), HOME)
    return made


def where(link: str, q: np.ndarray = HOME) -> Pose:
    return Pose.from_matrix(ur().link_poses(q)[link])


# ------------------------------------------------------------------------------------------------ bodies
def test_a_colliding_body_is_named_until_moved_or_deleted(world: CollisionWorld) -> None:
    assert world.is_free("arm", HOME)
    assert pairs(world) == set()
    tip = where("flange").position
    world.put("box", Box(0.04, 0.04, 0.02), at(*tip))
    assert not world.is_free("arm", HOME)
    assert pairs(world) == {("arm/wrist_3_link", "box")}
    (contact,) = world.contacts("arm", HOME)
    assert str(contact) == "arm/wrist_3_link and box"
    assert 0.0 < contact.depth < 0.05
    world.move("box", at(tip.x, tip.y, tip.z - 0.5))
    assert world.is_free("arm", HOME)
    world.put("box", Box(0.04, 0.04, 1.0), at(tip.x, tip.y, tip.z - 0.5))  # upsert: a larger one replaces it
    assert pairs(world) == {("arm/wrist_3_link", "box")}
    world.delete("box")
    assert world.is_free("arm", HOME)
    assert world.ids() == []
    for ask in (lambda: world.delete("box"), lambda: world.move("box", Pose()), lambda: world.pose("box")):
        with pytest.raises(NotFound, match="box"):
            ask()


SHAPES: list[Shape] = [
    Box(0.1, 0.2, 0.3),
    Cylinder(0.08, 0.2),
    Capsule(0.05, 0.2),
    Sphere(0.1),
    hull_of(trimesh.creation.box((0.1, 0.2, 0.3)).vertices, "a box"),
    triangles_of(Box(0.1, 0.2, 0.3)),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_every_shape_collides_at_its_surface(world: CollisionWorld, shape: Shape) -> None:
    tip = where("flange")
    half = float(extent(shape)[1, 2])
    beside = Pose(Position(0.0, 0.0, half + 0.002))
    world.put("body", shape, tip * beside)
    assert world.is_free("arm", HOME)
    near = world.clearance("arm", HOME, within=0.02)
    assert near is not None
    assert (near.first, near.second) == ("arm/wrist_3_link", "body")
    assert near.distance == pytest.approx(0.002, abs=2e-4)
    assert near.first_point.distance_to(near.second_point) == pytest.approx(near.distance, abs=1e-5)
    world.move("body", tip * Pose(Position(0.0, 0.0, half - 0.002)))
    assert pairs(world) == {("arm/wrist_3_link", "body")}


def test_a_margin_adds_distance() -> None:
    world = CollisionWorld(margin=0.05)
    world.add_robot("arm", ur(), Pose())
    world.put("body", Box(0.2, 0.2, 0.2), where("flange") * at(0.0, 0.0, 0.13))
    assert pairs(world) == {("arm/wrist_3_link", "body")}
    assert not world.is_free("arm", HOME)
    world.move("body", where("flange") * at(0.0, 0.0, 0.16))
    assert pairs(world) == set()  # its own links may come closer to each other
    assert world.is_free("arm", HOME)
    with pytest.raises(InvalidData, match="margin"):
        CollisionWorld(margin=-0.1)


def test_protocol_models_become_shapes() -> None:
    mesh = triangles_of(Box(1.0, 1.0, 1.0))
    assert of_model(object_type.Box("b", 1.0, 2.0, 3.0)) == Box(1.0, 2.0, 3.0)
    assert of_model(object_type.Cylinder("c", 1.0, 2.0)) == Cylinder(1.0, 2.0)
    assert of_model(object_type.Sphere("s", 1.0)) == Sphere(1.0)
    assert isinstance(of_model(object_type.Mesh("m", "m.stl"), mesh), Hull)
    assert isinstance(of_model(object_type.Mesh("m", "m.stl"), mesh, "exact"), TriangleMesh)
    with pytest.raises(BadMesh, match=r"m\.stl of m"):
        of_model(object_type.Mesh("m", "m.stl"))


def test_invalid_bodies_are_refused(world: CollisionWorld) -> None:
    with pytest.raises(ZeroLength, match="thin"):
        world.put("thin", Box(1.0, 0.0, 1.0), Pose())
    with pytest.raises(InvalidData, match="lost"):
        world.put("lost", Sphere(0.1), at(math.nan, 0.0, 0.0))
    with pytest.raises(Conflict, match="arm cannot be added: a robot has that id"):
        world.put("arm", Sphere(0.1), Pose())
    with pytest.raises(Conflict, match="arm"):
        world.add_robot("arm", ur(), Pose())
    with pytest.raises(InvalidData, match="6 finite joint values"):
        world.set_joints("arm", np.zeros(5))
    with pytest.raises(NotFound, match="nobody"):
        world.is_free("nobody", HOME)
    assert world.ids() == []


# ------------------------------------------------------------------------------------------------ robots
def test_self_collision_names_the_links(world: CollisionWorld) -> None:
    folded = np.array((0.0, -1.2, 3.0, 0.0, 0.0, 0.0))
    assert not world.is_free("arm", folded)
    assert all(each[0].startswith("arm/") and each[1].startswith("arm/") for each in pairs(world, folded))
    assert ("arm/upper_arm_link", "arm/wrist_1_link") in pairs(world, folded)


def test_the_table_under_a_robot_collides_only_with_its_arm(world: CollisionWorld) -> None:
    world.put("table", Box(2.0, 2.0, 0.1), at(0.0, 0.0, -0.05))
    assert world.is_free("arm", HOME)
    down = np.array((0.0, 0.3, 0.0, 0.0, 0.0, 0.0))
    assert any(other == "table" for _, other in pairs(world, down))
    assert not world.is_free("arm", down)


def test_two_robots_are_obstacles_for_each_other(world: CollisionWorld) -> None:
    reaching = np.array((0.0, -0.6, 0.4, 0.2, 0.0, 0.0))
    tip = where("flange", reaching).position
    foot = at(tip.x, tip.y, tip.z - 0.15)  # the arm reaches to the shoulder of the other robot
    world.add_robot("other", ur("ur3e"), foot, np.zeros(6))
    assert any(two.startswith("other/") for _, two in pairs(world, reaching))
    assert not world.is_free("arm", reaching)
    world.move_robot("other", at(0.6, 3.0, 0.0))
    assert world.is_free("arm", reaching)
    world.move_robot("other", foot)
    world.allow("arm", "other")
    assert world.is_free("arm", reaching)
    world.allow("other", "arm", allowed=False)
    assert not world.is_free("arm", reaching)
    world.remove_robot("other")
    assert world.is_free("arm", reaching)


def test_a_robot_is_placed_at_its_base() -> None:
    world = CollisionWorld()
    base = Pose(Position(3.0, -2.0, 1.0), Orientation.from_rotation_vector(0.3, 0.2, 1.0))
    world.add_robot("arm", ur(), base)
    world.put("body", Sphere(0.05), base * where("flange"))
    assert pairs(world) == {("arm/wrist_3_link", "body")}
    world.move_robot("arm", Pose())
    assert world.is_free("arm", HOME)
    world.move("body", where("flange"))
    assert not world.is_free("arm", HOME)


# ------------------------------------------------------------------------------------------------ held
def test_a_gripped_part_moves_with_the_gripper_and_collides_with_others(world: CollisionWorld) -> None:
    tip = where("flange")
    world.put("part", Box(0.05, 0.05, 0.2), tip * at(0.0, 0.0, 0.09))  # it reaches 10 mm into the flange
    assert pairs(world) == {("arm/wrist_3_link", "part")}
    world.attach("part", "arm", "flange")
    assert world.is_free("arm", HOME)
    assert world.ids() == ["part"]
    moved = HOME + np.array((0.5, 0.1, 0.0, -0.2, 0.3, 1.0))
    world.set_joints("arm", moved)
    expected = where("flange", moved) * at(0.0, 0.0, 0.09)
    assert np.allclose(world.pose("part").matrix(), expected.matrix(), atol=1e-9)
    world.put("wall", Box(0.02, 0.02, 0.02), expected * at(0.0, 0.0, 0.09))
    assert pairs(world, moved) == {("part", "wall")}
    assert not world.is_free("arm", moved)
    assert world.is_free("arm", HOME)
    with pytest.raises(Conflict, match="attached to arm"):
        world.attach("part", "arm", "flange")
    world.allow("part", "wall")
    assert world.is_free("arm", moved)
    world.allow("part", "wall", allowed=False)
    assert not world.is_free("arm", moved)
    world.delete("wall")
    left = world.detach("part")
    assert np.allclose(left.matrix(), expected.matrix(), atol=1e-9)
    assert pairs(world, moved) == {("arm/wrist_3_link", "part")}
    assert world.is_free("arm", HOME)
    with pytest.raises(NotFound, match="not attached"):
        world.detach("part")


def test_a_long_gripped_part_collides_with_its_arm(world: CollisionWorld) -> None:
    tip = where("flange")
    world.put("bar", Box(0.8, 0.03, 0.03), tip * at(0.3, 0.0, 0.02))
    world.attach("bar", "arm", "flange")
    turned = [HOME + np.array((0, 0, 0, 0, 0, angle)) for angle in np.linspace(0.0, 2.0 * math.pi, 25)]
    found = set().union(*(pairs(world, q) for q in turned))
    assert found
    assert found <= {(f"arm/{link}", "bar") for link in ur().links}
    assert any(world.is_free("arm", q) for q in turned)


def test_fingers_may_touch_the_gripped_part() -> None:
    box = '<collision><geometry><box size="0.02 0.02 0.1"/></geometry></collision>'
    text = links("base", "arm") + '<link name="hand"/>' + f'<link name="left">{box}</link><link name="far">{box}</link>'
    text += joint("j1", "base", "arm", xyz="0 0 0.5") + joint("j2", "arm", "hand", xyz="0.5 0 0")
    text += joint("finger", "hand", "left", kind="prismatic", axis="0 1 0", limit='<limit lower="0" upper="0.1"/>')
    text += joint("post", "base", "far", kind="fixed", xyz="0 1.5 0.5", limit="")
    world = CollisionWorld()
    world.add_robot("arm", RobotModel.load(urdf(text)), Pose(), np.zeros(3))
    world.put("part", Sphere(0.05), at(0.5, 0.0, 0.5))
    assert pairs(world, np.zeros(3)) == {("arm/left", "part")}
    world.attach("part", "arm", "hand")
    assert world.is_free("arm", np.zeros(3))


def test_gripped_parts_can_be_deleted_replaced_and_removed(world: CollisionWorld) -> None:
    world.put("part", Sphere(0.05), where("flange"))
    world.attach("part", "arm", "flange")
    world.put("part", Sphere(0.01), at(0.0, 0.0, 2.0))  # after another `put`, the body is no longer gripped
    assert world.pose("part") == at(0.0, 0.0, 2.0)
    world.move("part", where("flange"))
    world.attach("part", "arm", "flange")
    world.remove_robot("arm")
    assert np.allclose(world.pose("part").matrix(), where("flange").matrix())
    world.clear()
    assert (world.ids(), world.robots) == ([], {})


# ------------------------------------------------------------------------------------------------ lines
def depths(shape: Shape, points: np.ndarray) -> np.ndarray:
    """Return the depth of points below the nearest face of a convex shape's triangles, negative outside."""
    mesh = triangles_of(shape)
    first, second, third = (mesh.vertices[mesh.triangles[:, corner]] for corner in range(3))
    normals = np.cross(second - first, third - first)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return ((first * normals).sum(axis=1) - points @ normals.T).min(axis=1)


@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from(SHAPES),
    st.tuples(*[st.floats(-0.4, 0.4)] * 3),
    st.tuples(*[st.floats(-0.4, 0.4)] * 3),
    st.tuples(*[st.floats(-3.0, 3.0)] * 3),
)
def test_a_line_hits_a_shape_at_its_triangles(
    shape: Shape, start: tuple[float, ...], end: tuple[float, ...], turn: tuple[float, ...]
) -> None:
    pose = Pose(Position(1.0, -2.0, 0.5), Orientation.from_rotation_vector(*turn))
    a, b = (pose * at(*point) for point in (start, end))
    if a.position.distance_to(b.position) < 0.01:
        return
    world = CollisionWorld()
    world.put("body", shape, pose)
    hit = world.ray(a.position, b.position)
    points = np.array(start) + np.linspace(0.0, 1.0, 401)[:, None] * (np.array(end) - np.array(start))
    step = float(np.linalg.norm(points[1] - points[0]))
    inside = depths(shape, points)
    round_off = 0.002  # difference between 24 sides and a circle
    if hit is None:
        assert inside.max() < step + round_off or isinstance(shape, TriangleMesh)
        return
    assert hit.name == "body"
    local = pose.inverted() * Pose(hit.point)
    on = np.array([*local.position])
    assert np.allclose(on, np.array(start) + hit.share * (np.array(end) - np.array(start)), atol=1e-9)
    depth = float(depths(shape, on[None, :])[0])
    assert abs(depth) < round_off or (hit.share == 0.0 and depth > 0.0)
    before = inside[: int(hit.share * 400)]
    if not isinstance(shape, TriangleMesh):
        assert before.max(initial=-1.0) < step + round_off


def test_the_first_body_on_a_line_is_named_and_bodies_can_be_ignored(world: CollisionWorld) -> None:
    start, end = Position(-2.0, 0.0, 1.5), Position(2.0, 0.0, 1.5)
    assert world.ray(start, end) is None
    for number, x in enumerate((1.0, -1.0, 0.5)):
        world.put(f"post {number}", Cylinder(0.05, 1.0), at(x, 0.0, 1.5))
    hit = world.ray(start, end)
    assert hit is not None
    assert hit.name == "post 1"
    assert hit.point.x == pytest.approx(-1.05)
    other = world.ray(start, end, ignore=["post 1"])
    assert other is not None
    assert other.name == "post 2"
    beside = Position(-2.0, 0.055, 1.5), Position(2.0, 0.055, 1.5)
    assert world.ray(*beside) is None
    inflated = world.ray(*beside, inflation=0.01)
    assert inflated is not None
    assert inflated.name == "post 1"
    through_the_arm = world.ray(Position(0.0, 0.0, 2.0), Position(0.0, 0.0, 0.0))
    assert through_the_arm is not None
    assert through_the_arm.name.startswith("arm/")
    assert world.ray(Position(0.0, 0.0, 2.0), Position(0.0, 0.0, 0.0), ignore=["arm"]) is None
    with pytest.raises(InvalidData):
        world.ray(Position(math.nan, 0.0, 0.0), end)


def test_a_line_next_to_a_mesh_has_the_given_thickness() -> None:
    world = CollisionWorld()
    world.put("mesh", triangles_of(Box(0.2, 0.2, 0.2)), Pose())
    line = Position(-1.0, 0.104, 0.0), Position(1.0, 0.104, 0.0)
    assert world.ray(*line) is None
    hit = world.ray(*line, inflation=0.01)
    assert hit is not None
    assert hit.point.x == pytest.approx(-0.1, abs=0.01)
    assert world.ray(*line, inflation=0.007) is None


# ------------------------------------------------------------------------------------------------ many
def test_fast_and_exhaustive_checks_agree_for_a_thousand_bodies() -> None:
    chance = np.random.default_rng(4)
    world = CollisionWorld()
    world.add_robot("arm", RobotModel.load(UR / "ur5e"), Pose())
    for number in range(1000):
        place = chance.uniform((-1.2, -1.2, 0.0), (1.2, 1.2, 1.5))
        kind = [Box(0.04, 0.05, 0.06), Cylinder(0.02, 0.06), Sphere(0.03)][number % 3]
        turn = Orientation.from_rotation_vector(*chance.uniform(-2.0, 2.0, 3))
        world.put(f"body {number}", kind, Pose(Position(*map(float, place)), turn))
    world.allow("body 7", "arm/forearm_link")
    configurations = chance.uniform(-math.pi, math.pi, (150, 6))
    began = time.process_time()
    fast = [world.is_free("arm", q) for q in configurations]
    taken = (time.process_time() - began) / len(configurations)
    assert fast == [not world.contacts("arm", q) for q in configurations]
    assert 0 < sum(fast) < len(fast) or sum(fast) == 0
    assert taken < 0.002, f"{taken * 1e6:.0f} us"  # 20 to 50 us on an idle machine; with a check of each pair, 800 us
    for number in range(0, 1000, 2):
        world.delete(f"body {number}")
    for number in range(1, 1000, 2):
        world.move(f"body {number}", at(10.0, number, 0.0))
    assert all(world.is_free("arm", q) == (not world.robots["arm"].in_self_collision(q)) for q in configurations)


def test_changes_are_reported_with_their_region(world: CollisionWorld) -> None:
    before = world.revision
    world.put("a", Sphere(0.1), at(1.0, 2.0, 3.0))
    world.move("a", at(2.0, 2.0, 3.0))
    changes = world.changed_since(before)
    assert changes is not None
    assert [change.name for change in changes] == ["a", "a"]
    assert np.allclose(changes[1].box, ((0.9, 1.9, 2.9), (2.1, 2.1, 3.1)))
    assert world.changed_since(world.revision) == []
    for _ in range(5000):
        world.move("a", Pose())
    assert world.changed_since(before) is None
