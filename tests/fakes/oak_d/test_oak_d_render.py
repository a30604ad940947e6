"""Pictures of the fake camera compared with closed-form ray casting, and caching between frames."""

from typing import Any

import numpy as np
import pytest

from arcor2_fakes.oak_d.optics import Lens
from arcor2_fakes.oak_d.scene import Pose, Thing
from tests.calibration.depth_sensor import Capsule, Sensor

LENS = Lens(320, 180)
DOWN = Pose((0.0, 0.0, 0.8), (1.0, 0.0, 0.0, 0.0))
TILTED = (0.0, 0.5646425, 0.0, 0.8253356)


def new_renderer() -> Any:
    from arcor2_fakes.oak_d.render import Renderer  # loads Open3D, which takes a second

    return Renderer(LENS)


def capsule(x: float, radius: float = 0.05) -> Thing:
    return Thing(f"capsule {x}", Pose((x, 0.02, 0.2), TILTED), capsule=(radius, 0.2))


def test_depth_of_a_capsule_matches_the_closed_form() -> None:
    view = new_renderer().view(DOWN, 0.0, (capsule(0.05),))
    pose = capsule(0.05).pose.matrix()
    begin, end = ((pose @ [0, 0, z, 1.0])[:3] for z in (-0.1, 0.1))
    sensor = Sensor(320, 180, LENS.fx, LENS.fy, LENS.cx, LENS.cy, LENS.distortion, shapes=[Capsule(begin, end, 0.05)])
    exact = sensor.exact(DOWN.matrix())
    on = exact < 0.75
    assert np.count_nonzero(on) > 1000
    off = np.abs(view.depth - exact)[on]
    assert np.median(off) < 2e-4  # error of flat triangles for a round body
    assert np.count_nonzero(off > 2e-3) < 0.02 * np.count_nonzero(on)  # pixels at its rim
    np.testing.assert_allclose(view.depth[~on & (exact < 1.0)], exact[~on & (exact < 1.0)], atol=0.31)


def test_a_cylinder_has_flat_ends() -> None:
    upright = Pose((0.0, 0.0, 0.2))
    seen = [
        new_renderer().view(DOWN, 0.0, (thing,)).depth.min()
        for thing in (Thing("c", upright, cylinder=(0.05, 0.2)), Thing("c", upright, capsule=(0.05, 0.2)))
    ]
    assert seen == pytest.approx([0.5, 0.45], abs=1e-3)


def test_only_moved_bodies_are_rendered_again() -> None:
    """A view after many others equals that of a new renderer: no old body remains, no body is missing."""
    renderer = new_renderer()
    still = Thing("box", Pose((-0.2, 0.1, 0.05)), size=(0.1, 0.1, 0.1), color=(200, 30, 30))
    for x in (-0.1, 0.0, 0.1):
        renderer.view(DOWN, 0.0, (still, capsule(x)))
    later = (still, capsule(0.15, 0.03))
    for things in (later, later, (capsule(0.15, 0.03),), (still,)):
        found, fresh = renderer.view(DOWN, 0.0, things), new_renderer().view(DOWN, 0.0, things)
        np.testing.assert_array_equal(found.depth, fresh.depth)
        np.testing.assert_array_equal(found.color, fresh.color)


@pytest.mark.parametrize(
    "thing",
    [
        {"name": "a", "pose": {"position": [0, 0, 0]}, "capsule": [0.1, 0.2], "size": [1, 1, 1]},
        {"name": "a", "pose": {"position": [0, 0, 0]}, "capsule": [0.1, 0.0]},
        {"name": "a", "pose": {"position": [0, 0, 0]}, "cylinder": [0.1, 0.2], "marker": {"id": 1, "size": 0.1}},
    ],
    ids=["two forms", "no length", "marker on round"],
)
def test_an_invalid_round_body_is_refused(thing: dict[str, object]) -> None:
    import msgspec

    with pytest.raises(msgspec.ValidationError):
        msgspec.convert(thing, Thing)
