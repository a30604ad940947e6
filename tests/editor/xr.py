"""An emulated WebXR tablet or headset that sees the markers of the fake camera."""

import asyncio
import json
import math
from pathlib import Path
from typing import Any, Final

import numpy as np
from playwright.async_api import Page
from scipy.spatial.transform import Rotation

from tests.editor.camera_video import Array, Lens, Shot, look_at, picture_url
from tests.editor.screen import VIEWPORTS, Screen

_HERE: Final = Path(__file__).parent
_IWER: Final = _HERE.parents[1] / "editor" / "node_modules" / "iwer" / "build" / "iwer.min.js"
_FIELD: Final = 0.75
"""Vertical field of view of the emulated device, rad."""
_UPRIGHT: Final = Rotation.from_euler("YX", [0.6, -math.pi / 2])
_SHIFT: Final = np.array([0.2, 0.74, -0.7])
"""Pose of the workplace (z up) in the frame of WebXR (y up)."""
_FLIP: Final = Rotation.from_euler("x", math.pi)

LENS: Final = Lens(
    VIEWPORTS["ipad"]["width"], VIEWPORTS["ipad"]["height"], VIEWPORTS["ipad"]["height"] / 2 / math.tan(_FIELD / 2)
)
"""The lens of the emulated camera, whose pictures fill the screen."""
Point = tuple[float, float, float]
SHOTS: Final = [look_at(np.array(eye), LENS) for eye in ((0.15, -0.55, 0.6), (-0.2, -0.4, 0.7), (0.6, -0.5, 0.75))]
_PROJECTED: Final = """(points) => {
    const { view } = window.__engine, { left, top } = view.element.getBoundingClientRect();
    const { width, height } = window.__engine.shown();
    const Vector = view.target.constructor;
    view.camera.updateMatrixWorld();
    return points.map((point) => {
        const at = new Vector(...point).project(view.camera);
        return [left + ((at.x + 1) / 2) * width, top + ((1 - at.y) / 2) * height];
    });
}"""


_HAND_RAY: Final = """() => {
    const rays = [...(window.__ar?.headset?.poses ?? [])];
    const right = rays.find(([source]) => source.hand && source.handedness === "right");
    return right && Array.from(right[1].elements);
}"""


async def emulate(page: Page, *, headset: bool = False, pictures: bool = True, overlay: bool = True) -> None:
    """Emulate a WebXR device in the page. Call this before the page is opened."""
    options = {"headset": headset, "pictures": pictures, "overlay": overlay}
    await page.add_init_script(f"window.__xrOptions = {json.dumps(options)};")
    await page.add_init_script(_IWER.read_text())
    await page.add_init_script((_HERE / "xr_emulator.js").read_text())


def in_xr(point: Point, up: float = 0.0) -> Array:
    """Return a point of the workplace, or one above it, in the frame of WebXR, m."""
    moved: Array = _UPRIGHT.apply(np.add(point, (0, 0, up))) + _SHIFT
    return moved


def pose_of(shot: Shot) -> tuple[list[float], list[float]]:
    """Return the position and the quaternion x, y, z, w of the device that takes a shot, in the frame of WebXR."""
    turn = Rotation.from_matrix(shot.turn.T)
    eye = -shot.turn.T @ shot.shift
    return in_xr(tuple(eye)).tolist(), (_UPRIGHT * turn * _FLIP).as_quat().tolist()


async def place_device(screen: Screen, shot: Shot, picture: bool = True, off: Point = (0, 0, 0)) -> None:
    """Put the device at the pose of a shot, and show it the picture. `off` is the tracking error, m."""
    position, turn = pose_of(shot)
    arguments = [(np.array(position) + off).tolist(), turn, picture_url(shot) if picture else None]
    await screen.page.evaluate("(given) => __xr.place(...given)", arguments)


async def overlay_errors(screen: Screen, shot: Shot, points: list[Point]) -> list[float]:
    """Return the distance between the drawn and the true position of each point, m, measured at the point's depth."""
    shown = np.array(await screen.page.evaluate(_PROJECTED, points))
    true, depths = shot.project(points)
    errors: list[float] = (np.linalg.norm(shown - (true + 0.5), axis=1) * depths / shot.lens.focal).tolist()
    return errors


async def wait_for_overlay(screen: Screen, shot: Shot, points: list[Point], most: float) -> None:
    """Wait until the overlay error is at most `most`, m."""
    worst = math.inf
    for _ in range(400):
        worst = max(await overlay_errors(screen, shot, points))
        if worst <= most:
            return
        await asyncio.sleep(0.05)
    raise AssertionError(f"the overlay is {1000 * worst:.2f} mm off")


class Controller:
    """The right controller or hand of an emulated headset."""

    def __init__(self, screen: Screen) -> None:
        self.screen = screen

    async def _set_ray(self, position: Any, turn: Rotation) -> None:
        """Let the ray start at a position, with a direction."""
        await self._set_pose(position, turn)
        if ray := await self.screen.page.evaluate(_HAND_RAY):
            # The ray of a hand does not start in its frame.
            seen = Rotation.from_matrix(np.reshape(ray, (4, 4)).T[:3, :3])
            shift = turn.inv().apply(np.subtract(ray[12:15], position))
            turned = turn * (turn.inv() * seen).inv()
            await self._set_pose(position - turned.apply(shift), turned)

    async def _set_pose(self, position: Any, turn: Rotation) -> None:
        script = """([position, turn]) => {
            for (const each of [__xr.device.controllers.right, __xr.device.hands.right]) {
                each.position.set(...position);
                each.quaternion.set(...turn);
            }
        }"""
        await self.screen.page.evaluate(script, [list(map(float, position)), turn.as_quat().tolist()])
        await self.frames()

    async def frames(self, count: int = 4) -> None:
        """Wait for frames of the session."""
        await self.screen.page.evaluate(
            """async (count) => {
                const { session } = __xr.state;
                const ended = new Promise((done) => session.addEventListener("end", done, { once: true }));
                const frame = () => new Promise((done) => session.requestAnimationFrame(done));
                for (let n = 0; n < count && __ar; n++) await Promise.race([frame(), ended]);
            }""",
            count,
        )

    async def aim(self, at: Any, start: Any) -> None:
        """Aim the ray from a position at another, both in the frame of WebXR."""
        ahead = np.asarray(at, float) - start
        ahead /= np.linalg.norm(ahead)
        turn, _ = Rotation.align_vectors([ahead], [[0, 0, -1]])
        await self._set_ray(start, turn)

    async def touch(self, at: Any) -> None:
        """Hold the tip at a position."""
        await self._set_ray(at, Rotation.identity())

    async def button(self, name: str) -> None:
        """Point at a button of the panel."""
        at = await self.screen.until("(name) => __ar.headset.panel.middleOf(name)", name)
        await self.aim(at, np.add(at, (0.05, -0.1, 0.3)))

    async def press(self, down: bool) -> None:
        """Press or release the trigger, or pinch."""
        script = """(value) => {
            if (__xr.device.primaryInputMode === "hand") __xr.device.hands.right.updatePinchValue(value);
            else __xr.device.controllers.right.updateButtonValue("trigger", value);
        }"""
        await self.screen.page.evaluate(script, int(down))
        await self.frames()

    async def click(self) -> None:
        await self.press(True)
        await self.press(False)
