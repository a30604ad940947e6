"""The arm and the markers as sent to the camera: links touch, and end at the controller's flange."""

import itertools
import math
from typing import Any

import msgspec
import numpy as np
import pytest
from transforms3d.quaternions import quat2mat

from arcor2_fakes.cell import arm, seen_objects
from arcor2_fakes.cell.layout import Camera, Marker, Pose, from_rotation_vector
from arcor2_fakes.oak_d.scene import Thing
from arcor2_fakes.ur.kinematics import Chain, to_pose

BASE = Pose((0.3, -0.2, 0.1), (0.0, 0.0, math.sin(0.4), math.cos(0.4)))
TIP = Pose((0.0, 0.0, 0.15))
JOINTS = [(0.3, -1.3, 1.4, -1.2, -1.5, 0.2), (-2.0, -0.7, -1.9, 0.4, 1.1, 2.0), (0.0, -1.57, 0.0, -1.57, 0.0, 0.0)]


def matrix(pose: dict[str, Any]) -> np.ndarray:
    x, y, z, w = pose["orientation"]
    found = np.eye(4)
    found[:3, :3] = quat2mat((w, x, y, z))
    found[:3, 3] = pose["position"]
    return found


def ends(thing: dict[str, Any]) -> list[np.ndarray]:
    length = thing["capsule" if "capsule" in thing else "cylinder"][1]
    frame = matrix(thing["pose"])
    return [(frame @ [0.0, 0.0, sign * length / 2.0, 1.0])[:3] for sign in (-1.0, 1.0)]


@pytest.mark.parametrize("q", JOINTS)
@pytest.mark.parametrize("model", ["ur3e", "ur5e", "ur10e"])
def test_the_last_link_ends_at_the_flange_of_the_controllers_own_kinematics(model: str, q: tuple[float, ...]) -> None:
    x, y, z, rx, ry, rz = to_pose(Chain(model).forward(q))
    flange = from_rotation_vector((x, y, z, rx, ry, rz))
    half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    world_from_flange = BASE.matrix() @ half_turn @ flange
    found = arm.things(model, BASE.matrix(), q, TIP.matrix())
    last = ends(found["robot wrist 3"])[1]
    np.testing.assert_allclose(last, world_from_flange[:3, 3], atol=1e-6)
    gripper = matrix(found["robot gripper"]["pose"])
    np.testing.assert_allclose(gripper[:3, 2], world_from_flange[:3, 2], atol=1e-6)


@pytest.mark.parametrize("q", JOINTS)
def test_neighbouring_links_touch(q: tuple[float, ...]) -> None:
    """A wrong sign or offset in a frame would leave a gap between two links, in some joint state."""
    found = arm.things("ur5e", BASE.matrix(), q, TIP.matrix())
    names = ["foot", "shoulder", "upper arm", "elbow", "forearm", "wrist 1", "wrist 2", "wrist 3"]
    for one, other in itertools.pairwise(names):
        first, second = found[f"robot {one}"], found[f"robot {other}"]
        radii = sum(thing.get("capsule", thing.get("cylinder"))[0] for thing in (first, second))
        (a, b), (c, d) = ends(first), ends(second)
        steps = np.linspace(0.0, 1.0, 21)[:, None]
        gaps = np.linalg.norm((a + steps * (b - a))[:, None] - (c + steps * (d - c))[None], axis=-1)
        assert gaps.min() < radii + 0.006, (one, other)


def test_the_camera_receives_links_and_markers() -> None:
    camera = Camera(BASE, (0.08, 0.06, 0.002), markers=[Marker(7, Pose((0.1, 0.2, 0.05)), 0.06)])
    encoded = [*arm.things("ur5e", BASE.matrix(), JOINTS[0], TIP.matrix()).values(), *seen_objects.fixed(camera)]
    things = [msgspec.convert(msgspec.to_builtins(each), Thing) for each in encoded]
    marker = things[-1]
    assert marker.marker is not None
    assert (marker.marker.id, marker.marker.size) == (7, 0.06)
    assert marker.size is not None
    # the pose of the marker is that of its face: the paper is below it
    assert marker.pose.position[2] + marker.size[2] / 2.0 == pytest.approx(0.05)


def test_only_moved_links_are_sent() -> None:
    before = arm.things("ur5e", BASE.matrix(), JOINTS[0], TIP.matrix())
    q = (*JOINTS[0][:2], JOINTS[0][2] + 0.1, *JOINTS[0][3:])
    others, moved = seen_objects.changes(before, arm.things("ur5e", BASE.matrix(), q, TIP.matrix()))
    assert not others
    assert "robot forearm" in moved
    assert "robot upper arm" not in moved
