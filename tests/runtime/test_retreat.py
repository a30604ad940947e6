"""The path of a robot out of a zone: its retract path, or the shortest one."""

import math
from typing import Final

import pytest

from arcor2_hw.collision.description import Obstacle
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box, Cylinder, Models, Sphere
from arcor2_hw.data.operation import HoldKind
from arcor2_hw.exceptions import Cancelled, Interlocked
from arcor2_hw.runtime.messages import Lease
from arcor2_hw.runtime.retreat import MAX_SPEED, TOLERANCE, Retreat, ZoneExit, ends_outside

QUARTER: Final = Orientation(0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
AT: Final = Pose(Position(1.0, 2.0, 0.0), QUARTER)
BOX: Final = Box("zone", 0.4, 1.0, 2.0)


def is_near(found: Position | None, *expected: float) -> bool:
    return found is not None and found.distance_to(Position(*expected)) < 1e-9


@pytest.mark.parametrize(
    ("model", "tip", "direction", "depth"),
    [
        (BOX, Position(1.0, 2.05, 0.0), (0.0, 1.0, 0.0), 0.15),  # x of the body is y of the world
        (BOX, Position(1.45, 2.0, 0.0), (1.0, 0.0, 0.0), 0.05),
        (Sphere("zone", 0.5), Position(1.0, 2.0, -0.1), (0.0, 0.0, -1.0), 0.4),
        (Cylinder("zone", 0.5, 1.0), Position(1.0, 2.0, 0.45), (0.0, 0.0, 1.0), 0.05),
        (Cylinder("zone", 0.5, 2.0), Position(1.2, 2.0, 0.1), (1.0, 0.0, 0.0), 0.3),
    ],
)
def test_the_shortest_path_leads_to_the_nearest_surface(
    model: Models, tip: Position, direction: tuple[float, float, float], depth: float
) -> None:
    retreat = Retreat(Obstacle("zone", model, AT), [])
    assert is_near(retreat.direction(tip), *direction)
    assert retreat.remaining([tip]) == pytest.approx(depth)


def test_a_path_leads_around_the_corner() -> None:
    retreat = Retreat(Obstacle("zone", BOX, AT), [Position(), Position(0.0, 0.4), Position(0.5, 0.4)])
    assert is_near(retreat.direction(Position(1.0, 2.0, 0.0)), -1.0, 0.0, 0.0)
    assert retreat.remaining([Position(1.0, 2.0, 0.0)]) == pytest.approx(0.9)
    assert is_near(retreat.direction(Position(0.6, 2.0, 0.0)), 0.0, 1.0, 0.0)
    assert retreat.direction(Position(0.6, 2.499, 0.0)) is None


def test_only_paths_that_end_outside_are_accepted() -> None:
    assert ends_outside([Position(), Position(0.21)], BOX)
    assert not ends_outside([Position(0.21), Position(0.19)], BOX)


def jog(*twist: float, frame: str = "world", retract: bool = False) -> Lease:
    return Lease(1, "obj", 1, HoldKind.JOG, 1.0, None if retract else (*twist, 0.0, 0.0, 0.0), frame, retract=retract)  # type: ignore[arg-type]


def leaving(*tips: Position) -> ZoneExit:
    return ZoneExit("arm", {"zone": Retreat(Obstacle("zone", BOX, Pose()), [])}, tips)


def test_a_robot_leaves_slowly_and_only_outwards() -> None:
    tip = [Position(0.1)]
    motion = leaving(*tip)
    lease, scale = motion.steer(jog(0.2, 0.0, 0.0), tip)
    assert lease.twist is not None
    assert lease.twist[0] == pytest.approx(MAX_SPEED)
    assert scale == pytest.approx(0.25)
    assert motion.steer(jog(0.01, 0.0, 0.0), tip)[1] == 1.0
    for velocity in ((-0.1, 0.0, 0.0), (0.0, 0.1, 0.0)):
        with pytest.raises(Interlocked, match="not deeper"):
            motion.steer(jog(*velocity), tip)
    with pytest.raises(Interlocked, match="in the axes of the world"):
        motion.steer(jog(0.1, 0.0, 0.0, frame="tool"), tip)
    assert motion.steer(jog(retract=True), tip)[0].twist == (MAX_SPEED, 0.0, 0.0, 0.0, 0.0, 0.0)
    with pytest.raises(Cancelled, match="has left the zone"):
        motion.steer(jog(retract=True), [Position(0.201)])


def test_a_robot_that_moves_back_is_stopped() -> None:
    motion = leaving(Position(0.1))
    assert motion.check([Position(0.15)]) is None
    assert motion.check([Position(0.15 - 0.9 * TOLERANCE)]) is None
    assert "zone" in str(motion.check([Position(0.15 - 1.1 * TOLERANCE)]))
    motion.left("zone")
    assert motion.check([Position(0.0)]) is None
