"""Frames: rays compared with OpenCV, points of a plane, and camera data in images."""

import numpy as np
import pytest

from arcor2_hw.actions.json_values import decode_picture, encode
from arcor2_hw.data.base import now
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.objects.frame import PictureNote, cloud, rays

LENSES = {
    "none": [0.0, 0.0, 0.0, 0.0],
    "four": [0.05, -0.08, 0.001, -0.002],
    "five": [0.08, -0.14, 0.0004, -0.0006, 0.05],
    "rational": [6.1, 2.2, 0.0003, -0.0002, 0.07, 6.4, 4.1, 0.5],
    "thin prism": [0.08, -0.14, 0.0004, -0.0006, 0.05, 0.0, 0.0, 0.0, 0.001, -0.0005, 0.002, 0.0007],
}


@pytest.mark.parametrize("coefficients", LENSES.values(), ids=LENSES)
def test_rays_equal_those_of_opencv(coefficients: list[float]) -> None:
    import cv2

    parameters = CameraParameters(912.5, 912.1, 642.3, 357.8, coefficients)
    found = rays(parameters, 1280, 720)
    pixels = np.array([[u, v] for u in (0, 300, 640, 1279) for v in (0, 200, 360, 719)])
    points = np.append(found[pixels[:, 1], pixels[:, 0]], np.ones((len(pixels), 1)), axis=1).astype(np.float64)
    matrix = np.array([[912.5, 0, 642.3], [0, 912.1, 357.8], [0, 0, 1]])
    seen, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array(coefficients))
    assert np.abs(seen[:, 0] - pixels).max() < 0.05  # pixels
    with pytest.raises(ValueError, match="read-only"):
        found[0, 0] = 0


def test_depth_pixels_become_points_in_metres() -> None:
    parameters = CameraParameters(500.0, 500.0, 160.0, 120.0, [0.0] * 4)
    depth = np.full((240, 320), 750, np.uint16)
    depth[0, 0] = 0
    points = cloud(depth, parameters)
    assert points[120, 160] == pytest.approx([0.0, 0.0, 0.75])
    assert points[120, 260] == pytest.approx([0.15, 0.0, 0.75])
    assert np.isnan(points[0, 0]).all()


def test_a_depth_image_keeps_its_camera_data() -> None:
    from PIL import Image

    note = PictureNote(
        CameraParameters(500.0, 501.0, 160.0, 120.0, [0.1] * 5),
        Pose(Position(1.0, 2.0, 3.0), Orientation(1.0, 0.0, 0.0, 0.0)),
        now(),
        "camera",
    )
    depth = np.arange(12, dtype=np.uint16).reshape(3, 4) * 1000
    picture = note.put_on(Image.fromarray(depth))
    back = decode_picture(encode(picture))
    assert PictureNote.of(back) == note
    assert np.array_equal(np.asarray(back), depth)
    with pytest.raises(InvalidData, match="has no camera data"):
        PictureNote.of(Image.fromarray(depth))
    back.info["arcor2_view"] = "{}"
    with pytest.raises(InvalidData, match="camera data of the image is not valid"):
        PictureNote.of(back)
