"""Crates rendered with noise, as pictures of a camera."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from transforms3d.euler import euler2quat

from arcor2_drivers.bin_picking.bin import Bin
from arcor2_drivers.bin_picking.settings import BinSettings
from arcor2_hw.data.base import now
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.objects.frame import PictureNote

LENGTH, WIDTH, HEIGHT, WALL = 0.30, 0.20, 0.08, 0.004
CRATE = Pose(Position(0.05, -0.03, 0.003), Orientation(0.0, 0.0, np.sin(0.15), np.cos(0.15)))
CAMERA = Pose(Position(0.0, 0.0, 0.72), Orientation(1.0, 0.0, 0.0, 0.0))
PART = (0.09, 0.05, 0.03)


def turned(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Orientation:
    w, i, j, k = euler2quat(*np.radians([x, y, z]))
    return Orientation(float(i), float(j), float(k), float(w))


def at(x: float, y: float, z: float, turn: Orientation | None = None) -> Pose:
    """Convert a pose in the crate to the world."""
    return CRATE * Pose(Position(x, y, z), turn or Orientation())


def encoded(pose: Pose) -> dict[str, Any]:
    return {"position": list(pose.position), "orientation": list(pose.orientation)}


def part(name: str, pose: Pose, size: tuple[float, float, float] = PART) -> dict[str, Any]:
    return {"name": name, "pose": encoded(pose), "size": size, "color": (60, 120, 160)}


def crate() -> list[dict[str, Any]]:
    half = HEIGHT / 2.0
    walls = {
        "floor": (at(0, 0, -0.0015), (LENGTH, WIDTH, 0.003)),
        "left": (at(-(LENGTH + WALL) / 2, 0, half), (WALL, WIDTH + 2 * WALL, HEIGHT)),
        "right": (at((LENGTH + WALL) / 2, 0, half), (WALL, WIDTH + 2 * WALL, HEIGHT)),
        "front": (at(0, -(WIDTH + WALL) / 2, half), (LENGTH, WALL, HEIGHT)),
        "back": (at(0, (WIDTH + WALL) / 2, half), (LENGTH, WALL, HEIGHT)),
    }
    return [part(name, pose, size) for name, (pose, size) in walls.items()]


class Photographer:
    """Renders pictures with one lens; only the first takes long."""

    def __init__(self) -> None:
        from arcor2_fakes.oak_d.optics import Lens
        from arcor2_fakes.oak_d.render import Renderer
        from arcor2_fakes.oak_d.scene import Pose as ScenePose, Scene
        from arcor2_fakes.oak_d.sensor import Sensor

        self._lens = Lens(960, 540)
        self._renderer, self._sensor = Renderer(self._lens), Sensor(960, 540, 1.0, 7)
        self._scene = Scene(ScenePose((0.0, 0.0, 0.7), (1.0, 0.0, 0.0, 0.0)), 0.0)
        self._number = 0

    def __call__(self, *things: dict[str, Any], camera: Pose = CAMERA, with_crate: bool = True) -> Any:
        """Return a depth picture of objects, in the crate."""
        from PIL import Image

        self._number += 1
        self._scene.replace([*(crate() if with_crate else []), *things])
        self._scene.look_from(encoded(camera))
        view = self._renderer.view(self._scene.camera, 0.0, self._scene.things)
        depth = self._sensor.depth(view, self._number, covered=False)
        lens = self._lens
        parameters = CameraParameters(lens.fx, lens.fy, lens.cx, lens.cy, list(lens.distortion))
        return PictureNote(parameters, camera, now(), "camera").put_on(Image.fromarray(depth))


@pytest.fixture(scope="module")
def picture() -> Photographer:
    return Photographer()


@pytest.fixture
def make() -> Iterator[Callable[..., Bin]]:
    made: list[Bin] = []

    def build(**settings: Any) -> Bin:
        sizes = dict(zip(("part_length", "part_width", "part_height"), PART, strict=True))
        if settings.get("part_mesh"):
            sizes = {}
        given = BinSettings(LENGTH, WIDTH, HEIGHT, **{**sizes, **settings})
        found = Bin("bin_id", "crate", CRATE, given)
        made.append(found)
        found.connect()
        return found

    yield build
    for each in made:
        each.disconnect()
