"""The picture of a camera that moves around markers, for Chromium's fake camera, with the true pose of each picture."""

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

WIDTH: Final = 1280
HEIGHT: Final = 720
FOCAL: Final = 1040.0
"""Focal length, pixels."""
SIZE: Final = 0.1
"""Side of a marker, m."""
MARKERS: Final = {10: (0.0, 0.0, 0.0), 11: (0.38, 0.05, 0.4)}
"""Markers on the table by id: x and y, m, and angle about z, rad."""
MIDDLE: Final = (0.19, 0.025, 0.0)
"""Point between the markers."""
FIELD: Final = 16
"""Side of the squares that encode the frame number in the upper left corner of a frame, pixels."""
BITS: Final = 8
"""Number of these squares, one for each bit."""
CAMERA_ARGUMENTS: Final = (
    "--use-fake-ui-for-media-stream",
    "--use-fake-device-for-media-stream",
    "--disable-gpu-memory-buffer-video-frames",
)
_SUPERSAMPLING: Final = 2
"""Supersampling factor. Frames are drawn larger by this factor and then reduced."""
_MARGIN: Final = 40
_BLACK: Final = 240
"""Margin and black square of the drawing of a marker, pixels."""


@dataclass(frozen=True)
class Lens:
    """Size of pictures and focal length, pixels."""

    width: int = WIDTH
    height: int = HEIGHT
    focal: float = FOCAL


@dataclass(frozen=True)
class Shot:
    """A pose of the camera: camera = turn * world + shift; x right, y down, z forward."""

    turn: Array
    shift: Array
    lens: Lens = Lens()

    def project(self, points: Any) -> tuple[Array, Array]:
        """Return the pixels of points of the world and their depths, m."""
        seen = np.asarray(points, float) @ self.turn.T + self.shift
        middle = ((self.lens.width - 1) / 2, (self.lens.height - 1) / 2)
        return self.lens.focal * seen[:, :2] / seen[:, 2:] + middle, seen[:, 2]


def marker_table() -> dict[str, Any]:
    """Return the configuration of the markers."""
    markers = [
        {
            "marker_id": number,
            "pose": {
                "position": {"x": x, "y": y, "z": 0},
                "orientation": {"x": 0, "y": 0, "z": float(np.sin(angle / 2)), "w": float(np.cos(angle / 2))},
            },
        }
        for number, (x, y, angle) in MARKERS.items()
    ]
    return {"marker_size": SIZE, "markers": markers}


def write_video(file: Path, pictures: int = 40) -> list[Shot]:
    """Write an MJPEG video with the frame number drawn into each frame, and return the camera pose of each frame."""
    random = np.random.default_rng(3)
    shots, stream = [], b""
    for number in range(pictures):
        part = number / (pictures - 1)
        angle, distance = -2.2 + 1.4 * part, 0.6 + 0.5 * part
        shot = look_at(np.array(MIDDLE) + distance * np.array([0.7 * np.cos(angle), 0.7 * np.sin(angle), 0.7]))
        drawn = _drawn(shot, random)
        for bit in range(BITS):
            drawn[:FIELD, bit * FIELD : (bit + 1) * FIELD] = 255 if number >> bit & 1 else 0
        picture = cv2.cvtColor(drawn, cv2.COLOR_GRAY2BGR)
        stream += cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()
        shots.append(shot)
    file.write_bytes(stream)
    return shots


def picture_url(shot: Shot, seed: int = 3) -> str:
    """Return the picture of a shot as a URL with its content."""
    picture = cv2.imencode(".png", _drawn(shot, np.random.default_rng(seed)))[1].tobytes()
    return f"data:image/png;base64,{base64.b64encode(picture).decode()}"


def look_at(eye: Array, lens: Lens = Lens(), at: tuple[float, float, float] = MIDDLE) -> Shot:
    """Return the shot of a camera that looks at a point, by default at the middle of the markers, upright."""
    forward = (np.array(at) - eye) / np.linalg.norm(np.array(at) - eye)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    turn = np.stack([right, np.cross(forward, right), forward])
    return Shot(turn, -turn @ eye, lens)


def _drawn(shot: Shot, random: np.random.Generator) -> npt.NDArray[np.uint8]:
    width, height = shot.lens.width, shot.lens.height
    size = (width * _SUPERSAMPLING, height * _SUPERSAMPLING)
    coarse = random.normal(125, 14, (height // 20, width // 20)).astype(np.float32)
    picture = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    for marker, (x, y, angle) in MARKERS.items():
        drawing = cv2.aruco.generateImageMarker(dictionary, marker, _BLACK)
        drawing = cv2.copyMakeBorder(drawing, *[_MARGIN] * 4, cv2.BORDER_CONSTANT, value=255)
        side = len(drawing)
        half = SIZE / 2 * side / _BLACK
        corners = np.array([[-half, half], [half, half], [half, -half], [-half, -half]])
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        world = np.column_stack([corners @ turn.T + (x, y), np.zeros(4)])
        # Pixel centres have whole coordinates, in the fine picture too.
        seen = ((shot.project(world)[0] + 0.5) * _SUPERSAMPLING - 0.5).astype(np.float32)
        edge = side - 0.5
        drawn = np.array([[-0.5, -0.5], [edge, -0.5], [edge, edge], [-0.5, edge]], np.float32)
        to = cv2.getPerspectiveTransform(drawn, seen)
        paper = cv2.warpPerspective(drawing.astype(np.float32) * 0.7 + 40, to, size, flags=cv2.INTER_AREA)
        mask = cv2.warpPerspective(np.ones_like(drawing), to, size, flags=cv2.INTER_NEAREST)
        picture = np.where(mask > 0, paper, picture)
    reduced = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
    soft = cv2.GaussianBlur(reduced, (0, 0), 0.7)
    return np.clip(soft + random.normal(0, 2.5, soft.shape), 0, 255).astype(np.uint8)
