"""The world with the fake controller and camera: the camera sees the arm at its joint values, and the markers."""

import json
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import arcor2_fakes.cell
from arcor2_fakes.cell.layout import from_rotation_vector
from arcor2_fakes.oak_d.optics import Lens
from arcor2_fakes.oak_d.scene import Pose as Look, Scene

EXAMPLE = json.loads(Path(arcor2_fakes.cell.__file__).with_name("example.json").read_text())
MARKERS = [
    {"id": 10, "pose": {"position": [0.1, -0.3, -0.019]}, "size": 0.08},
    {"id": 11, "pose": {"position": [0.65, -0.2, -0.019]}, "size": 0.08},
]
CAMERA = {"pose": {"position": [0.4, -0.2, 1.0], "orientation": [1.0, 0.0, 0.0, 0.0]}, "board": [0.08, 0.06, 0.002]}
MOVE = "def nod():\n  movej([0.5, -1.2, 1.3, -1.6, -1.5, 0.1], a=12, v=3.1)\nend\n"
HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])


@pytest.fixture
def cell(start_fake: Callable[..., Any], tmp_path: Path) -> tuple[Any, Any, Any]:
    layout = {**EXAMPLE, "robot": {**EXAMPLE["robot"], "model": "ur5e"}, "camera": {**CAMERA, "markers": MARKERS}}
    path = tmp_path / "layout.json"
    path.write_text(json.dumps(layout))
    ur = start_fake("ur", *(part for name in ("rtde", "script", "dashboard") for part in (f"--{name}-port", "0")))
    camera = start_fake("oak_d", "--width", "320", "--height", "180")
    others = {"tester": start_fake("functional_tester"), "reader": start_fake("barcode_reader")}
    fakes = {"robot": ur, "camera": camera, **others}
    follows = [part for name, fake in fakes.items() for part in (f"--{name}", fake.ready["control"])]
    return ur, camera, start_fake("cell", "--layout", str(path), "--boards", "1", *follows)


def flange_seen(things: list[dict[str, Any]]) -> np.ndarray | None:
    found = next((thing for thing in things if thing["name"] == "robot wrist 3"), None)
    if found is None:
        return None
    pose = Look(tuple(found["pose"]["position"]), tuple(found["pose"]["orientation"])).matrix()
    return np.asarray((pose @ [0.0, 0.0, found["cylinder"][1] / 2.0, 1.0])[:3])


def flange_of(truth: dict[str, Any]) -> np.ndarray:
    tcp, offset = (from_rotation_vector(tuple(truth[name])) for name in ("tcp_pose", "tcp_offset"))
    return np.asarray((HALF_TURN @ tcp @ np.linalg.inv(offset))[:3, 3])


def test_the_camera_sees_the_arm_follow_its_joints_and_the_markers(cell: tuple[Any, Any, Any]) -> None:
    ur, camera, world = cell

    def in_place(truth: dict[str, Any]) -> bool:
        seen = flange_seen(truth["things"])
        return seen is not None and float(np.linalg.norm(seen - flange_of(ur.truth()))) < 1e-3

    before = camera.control.wait_until(in_place, within=20.0)
    host, port = ur.ready["script"].split(":")
    with socket.create_connection((host, int(port)), 2.0) as script:
        script.sendall(MOVE.encode())
    ur.control.wait_until(lambda truth: truth["program"] is None and truth["q"][0] > 0.4, within=30.0)
    after = camera.control.wait_until(in_place, within=20.0)
    first, second = flange_seen(before["things"]), flange_seen(after["things"])
    assert first is not None
    assert second is not None
    assert np.linalg.norm(second - first) > 0.1

    from arcor2_fakes.oak_d.render import Renderer  # loads Open3D, which takes a second

    truth = world.truth()
    assert [marker["id"] for marker in truth["markers"]] == [10, 11]
    assert truth["camera"]["position"] == CAMERA["pose"]["position"]
    assert truth["robot_base"]["position"] == EXAMPLE["robot"]["base"]["position"]
    scene = Scene(Look((0.0, 0.0, 1.0)), 0.0)
    scene.replace(thing for thing in after["things"] if thing["name"].startswith("marker"))
    scene.look_from(after["camera"])
    lens = Lens(1280, 720)
    picture = Renderer(lens).view(scene.camera, -0.02, scene.things).color
    corners, ids, _ = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)).detectMarkers(
        picture
    )
    found = {int(number): corner.reshape(4, 2) for number, corner in zip(ids.ravel(), corners, strict=True)}
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    rotation = cv2.Rodrigues(scene.camera.matrix()[:3, :3].T)[0]
    shift = -scene.camera.matrix()[:3, :3].T @ scene.camera.matrix()[:3, 3]
    for marker in MARKERS:
        x, y, z = marker["pose"]["position"]  # type: ignore[index]
        half = marker["size"] / 2.0  # type: ignore[operator]
        places = np.array([[x + a * half, y + b * half, z] for a, b in ((-1, 1), (1, 1), (1, -1), (-1, -1))])
        expected = cv2.projectPoints(places, rotation, shift, matrix, np.array(lens.distortion))[0].reshape(4, 2)
        np.testing.assert_allclose(found[marker["id"]], expected, atol=1.5)  # type: ignore[index]
