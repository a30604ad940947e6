"""The next part of a crate, in noisy rendered pictures with known ground truth, and refusals."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from arcor2_drivers.bin_picking.bin import Bin
from arcor2_drivers.bin_picking.errors import BadFit, Empty, PartsTouch
from arcor2_hw.actions.json_values import decode_picture, encode
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import Cancelled, InvalidData, NoDepth, NotConnected, OutOfRange, Stale
from arcor2_hw.objects.frame import PictureNote

from .conftest import CRATE, PART, Photographer, at, part, turned

FLAT = PART[2] / 2
CLOSE = 1.0
"""Size of a pixel at this distance, mm."""
SAME = (Orientation(), Orientation(1, 0, 0, 0), Orientation(0, 1, 0, 0), Orientation(0, 0, 1, 0))
"""Rotations after which a box looks the same."""


def looking(at_: Position, x: float, y: float, z: float) -> Pose:
    """Return the pose of a camera that looks at a point."""
    eye = np.array([x, y, z])
    forward = np.array(tuple(at_)) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    matrix[:3, 3] = eye
    return Pose.from_matrix(matrix)


def errors(found: Pose, truth: Pose) -> tuple[float, float]:
    """Return the position error (mm) and the orientation error (degrees) of the found pose of a box."""
    turn = min((truth.orientation * same).angle_to(found.orientation) for same in SAME)
    return 1000.0 * found.position.distance_to(truth.position), float(np.degrees(turn))


POSES = {
    "flat": at(0.05, 0.02, FLAT, turned(z=37)),
    "on its side, at the wall": at(-0.08, -0.05, PART[1] / 2, turned(x=90, z=10)),
    "upright": at(-0.05, 0.0, PART[0] / 2, turned(y=90)),
    "leaning": at(0.0, 0.0, 0.04, turned(x=25, z=20)),
}


@pytest.mark.parametrize("truth", POSES.values(), ids=POSES)
def test_a_single_part_is_found(picture: Photographer, make: Callable[..., Bin], truth: Pose) -> None:
    pose, quality = make().next_part(picture(part("a", truth)))
    distance, turn = errors(pose, truth)
    print(f"off by {distance:.2f} mm, {turn:.2f} degrees; quality {quality:.3f}")  # noqa: T201
    assert distance < CLOSE
    assert turn < 1.0
    assert quality > 0.95


def test_parts_are_found_in_many_poses(picture: Photographer, make: Callable[..., Bin]) -> None:
    rng, crate, found = np.random.default_rng(3), make(), []
    for _ in range(6):
        truth = at(rng.uniform(-0.08, 0.08), rng.uniform(-0.04, 0.04), FLAT, turned(z=rng.uniform(-180, 180)))
        pose, _ = crate.next_part(picture(part("a", truth)))
        found.append(errors(pose, truth))
        assert (pose.orientation.matrix() @ CRATE.orientation.inverted().matrix())[2, 2] > 0.99  # z upwards
    distance, turn = np.array(found).T
    print(f"median {np.median(distance):.2f} mm, worst {distance.max():.2f} mm, {turn.max():.2f} degrees")  # noqa: T201
    assert distance.max() < CLOSE
    assert turn.max() < 1.0


def test_an_oblique_camera_and_a_streamed_picture(picture: Photographer, make: Callable[..., Bin]) -> None:
    truth = at(0.05, 0.02, FLAT, turned(z=37))
    photo = picture(part("a", truth), camera=looking(CRATE.position, 0.3, -0.3, 0.6))
    pose, quality = make().next_part(decode_picture(encode(photo)))
    distance, turn = errors(pose, truth)
    assert (distance < CLOSE, turn < 0.6, quality > 0.97) == (True, True, True)


def test_the_highest_part_is_next(picture: Photographer, make: Callable[..., Bin]) -> None:
    low, high = at(0.09, 0.05, FLAT, turned(z=5)), at(-0.06, -0.03, PART[1] / 2, turned(x=90, z=70))
    pose, _ = make().next_part(picture(part("low", low), part("high", high)))
    assert errors(pose, high)[0] < CLOSE
    below, upon = at(0.0, 0.0, FLAT), at(0.02, 0.0, 3 * FLAT, turned(z=60))
    pose, _ = make().next_part(picture(part("below", below), part("upon", upon)))
    assert errors(pose, upon)[0] < CLOSE


def test_unreachable_and_missing_parts_are_refused(picture: Photographer, make: Callable[..., Bin]) -> None:
    crate = make()
    with pytest.raises(Empty, match=r"^crate is empty$") as empty:
        crate.next_part(picture())
    assert empty.value.code == "empty"
    assert crate.is_empty(picture())
    one, other = at(0.0, 0.0, FLAT), at(0.0, PART[1], FLAT)
    both = picture(part("one", one), part("other", other))
    with pytest.raises(PartsTouch, match=r"^crate: an object is larger than one part"):
        crate.next_part(both)
    assert not crate.is_empty(both)
    wrong = at(0.0, 0.0, FLAT, turned(z=20))
    with pytest.raises(BadFit, match=r"^crate: no object fits the part: best quality 0\.\d\d, 0\.9 required"):
        crate.next_part(picture(part("wrong", wrong, (0.06, 0.04, 0.03))))
    with pytest.raises(NoDepth, match=r"^crate is not visible"):
        crate.next_part(picture(camera=Pose(Position(0.6, 0.5, 0.7), Orientation(1, 0, 0, 0))))
    # Two parts touch each other, the third is separate: the third is found.
    free = at(-0.11, 0.0, FLAT, turned(z=90))
    pose, _ = crate.next_part(picture(part("one", one), part("other", other), part("free", free)))
    assert errors(pose, free)[0] < CLOSE


def test_a_displaced_crate_is_tolerated(picture: Photographer, make: Callable[..., Bin]) -> None:
    """The floor is 6 mm higher than the pose of the crate says; it is not mistaken for parts."""
    crate = make()
    crate.set_pose(CRATE * Pose(Position(0.0, 0.0, -0.006)))
    assert crate.is_empty(picture())
    truth = at(0.03, 0.0, FLAT, turned(z=15))
    assert errors(crate.next_part(picture(part("a", truth)))[0], truth)[0] < CLOSE


def test_parts_are_found_by_mesh(picture: Photographer, make: Callable[..., Bin], tmp_path: Any) -> None:
    """An angle bracket whose origin is at its corner, so that its pose differs from that of its centre."""
    import open3d as o3d

    foot = o3d.geometry.TriangleMesh.create_box(0.08, 0.04, 0.01)
    leg = o3d.geometry.TriangleMesh.create_box(0.01, 0.04, 0.05)
    file = tmp_path / "angle.stl"
    mesh = foot + leg
    mesh.compute_triangle_normals()
    assert o3d.io.write_triangle_mesh(str(file), mesh)
    truth = at(0.02, -0.03, 0.0, turned(z=130))
    thing = {"name": "angle", "pose": part("x", truth)["pose"], "mesh": str(file)}
    crate = make(part_mesh=str(file))
    pose, quality = crate.next_part(picture(thing))
    distance = 1000.0 * pose.position.distance_to(truth.position)
    turn = float(np.degrees(truth.orientation.angle_to(pose.orientation)))
    print(f"off by {distance:.2f} mm, {turn:.2f} degrees; quality {quality:.3f}")  # noqa: T201
    assert (distance < CLOSE, turn < 0.8, quality > 0.93) == (True, True, True)
    tool = crate.grip_pose(pose, 0.1)
    middle = truth * Pose(Position(0.04, 0.02, 0.15))  # above the centre, 0.1 m over its highest point
    assert tool.position.distance_to(middle.position) < 0.001


def test_grip_pose(make: Callable[..., Bin]) -> None:
    crate = make(grip_depth=0.004)
    lying = at(0.05, 0.02, PART[1] / 2, turned(x=90, z=37))
    tool = crate.grip_pose(lying)
    assert tool.position.distance_to(at(0.05, 0.02, PART[1] - 0.004).position) < 1e-9
    axes = tool.orientation.matrix()
    assert axes[:, 2] == pytest.approx(-CRATE.orientation.matrix()[:, 2], abs=1e-9)
    assert axes[:, 0] == pytest.approx(lying.orientation.matrix()[:, 0], abs=1e-9)
    upright = crate.grip_pose(at(0.0, 0.0, PART[0] / 2, turned(y=90)))
    assert np.abs(upright.orientation.matrix()[:, 2] @ CRATE.orientation.matrix()[:, 2]) == pytest.approx(1.0)


def test_invalid_pictures_are_refused(picture: Photographer, make: Callable[..., Bin]) -> None:
    from PIL import Image

    crate, photo = make(), picture()
    with pytest.raises(InvalidData, match=r"^crate: the image has no camera data"):
        crate.next_part(Image.fromarray(np.asarray(photo)))
    with pytest.raises(OutOfRange, match=r"^crate: depth must be an image with 16 bits"):
        crate.next_part(PictureNote.of(photo).put_on(Image.new("RGB", (64, 48))))
    old = PictureNote.of(photo)
    ancient = PictureNote(old.parameters, old.pose, "2020-01-01T00:00:00+00:00", old.camera)
    with pytest.raises(Stale, match=r"^crate: the image of camera is"):
        crate.next_part(ancient.put_on(photo))
    crate.disconnect()
    with pytest.raises(NotConnected, match=r"^crate is not connected"):
        crate.next_part(photo)


def test_stop_ends_a_search(picture: Photographer, make: Callable[..., Bin], monkeypatch: pytest.MonkeyPatch) -> None:
    from arcor2_drivers.bin_picking import finder  # loads Open3D, which takes a second

    bin_ = make()
    register = finder.register

    def stopped_meanwhile(*given: Any) -> Any:
        bin_.stop()
        return register(*given)._replace(quality=0.0)

    view = picture(part("a", at(-0.05, 0.0, FLAT)), part("b", at(0.07, 0.0, FLAT)))
    monkeypatch.setattr(finder, "register", stopped_meanwhile)
    with pytest.raises(Cancelled, match="stopped"):
        bin_.next_part(view)
    monkeypatch.undo()
    assert bin_.next_part(view)[1] > 0.9
