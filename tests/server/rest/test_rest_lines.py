"""Lines through boxes, spheres and cylinders, compared with their sampled points."""

import math

from hypothesis import given, settings, strategies as st

from arcor2_hw.collision.description import Obstacle
from arcor2_hw.collision.lines import Hit, first_hit
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box, Cylinder, Mesh, Models, Sphere


def inside(point: Position, placed: Obstacle, inflation: float) -> bool:
    """Compute by definition, for comparison, whether a point is inside."""
    local = (point - placed.pose.position).rotated(placed.pose.orientation.inverted())
    match placed.model:
        case Box() as box:
            halves = ((size + inflation) / 2 for size in (box.size_x, box.size_y, box.size_z))
            return all(abs(x) <= half for x, half in zip(local, halves, strict=True))
        case Sphere() as sphere:
            return math.hypot(*local) <= sphere.radius + inflation
        case Cylinder() as cylinder:
            radius = math.hypot(local.x, local.y)
            return radius <= cylinder.radius + inflation and abs(local.z) <= (cylinder.height + inflation) / 2
    raise AssertionError(placed)


coordinates = st.floats(-2, 2)
positions = st.builds(Position, coordinates, coordinates, coordinates)
poses = st.builds(
    Pose,
    positions,
    st.builds(Orientation.from_rotation_vector, st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3)),
)
sizes = st.floats(0.05, 2)
models: st.SearchStrategy[Models] = st.one_of(
    st.builds(Box, st.just("x"), sizes, sizes, sizes),
    st.builds(Sphere, st.just("x"), sizes),
    st.builds(Cylinder, st.just("x"), sizes, sizes),
)
SAMPLES = 200
SHARES = [n / SAMPLES for n in range(SAMPLES + 1)]


@settings(max_examples=200, deadline=None)
@given(positions, positions, st.builds(Obstacle.of, models, poses), st.sampled_from([0.0, 0.01, 0.3]))
def test_a_line_hits_shapes_that_contain_its_points(
    start: Position, end: Position, placed: Obstacle, inflation: float
) -> None:
    direction = end - start
    samples = [start + Position(direction.x * share, direction.y * share, direction.z * share) for share in SHARES]
    hit = first_hit(start, end, [("it", placed)], inflation) is not None
    # Between two samples a line can graze a body unnoticed. Only then may the results differ, and only slightly.
    if hit:
        near = inflation + math.hypot(*direction) / SAMPLES * 2 + 1e-9
        assert any(inside(point, placed, 2 * near) for point in samples)
    else:
        assert not any(inside(point, placed, inflation - 1e-9) for point in samples)


def test_shapes_grow_by_the_given_margin() -> None:
    for model, reach in ((Box("x", 1, 1, 1), 0.505), (Sphere("x", 0.5), 0.51), (Cylinder("x", 0.5, 1), 0.51)):
        placed = [("x", Obstacle.of(model, Pose()))]
        for y, free in ((reach - 1e-6, False), (reach + 1e-6, True)):
            assert (first_hit(Position(-2, y), Position(2, y), placed, 0.01) is None) is free, (model, y)
    top = [("x", Obstacle.of(Cylinder("x", 0.5, 1), Pose()))]
    assert first_hit(Position(0, 0, 0.506), Position(0.1, 0, 0.506), top, 0.01) is None
    assert first_hit(Position(0, 0, 0.504), Position(0.1, 0, 0.504), top, 0.01) == Hit("x", 0.0)


def test_a_line_of_length_zero_or_from_inside_hits_the_shape() -> None:
    ball = [("x", Obstacle.of(Sphere("x", 1), Pose()))]
    assert first_hit(Position(), Position(), ball, 0.0) == Hit("x", 0.0)
    assert first_hit(Position(2), Position(2), ball, 0.0) is None
    assert first_hit(Position(), Position(5), ball, 0.0) == Hit("x", 0.0)
    assert first_hit(Position(5), Position(9), ball, 0.0) is None, "behind the start there is no line"
    assert first_hit(Position(-2), Position(2), [("x", Obstacle.of(Mesh("x", "file"), Pose()))], 0.0) is None
