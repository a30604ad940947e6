"""Errors of the AR overlay, compared with the true pose of the fake camera."""

from typing import Any, Final

import numpy as np

from tests.editor.camera_video import BITS, FIELD, FOCAL, HEIGHT, WIDTH, Shot
from tests.editor.screen import Screen

_PROBE: Final = """([points, bits, field]) => {
    const engine = window.__engine, { camera } = engine.view;
    const sheet = engine.scene.children.find((each) => each.material?.map);
    const canvas = sheet?.material.map.image;
    if (!engine.view.measured || !canvas) return null;
    camera.updateMatrixWorld();
    const row = canvas.getContext("2d").getImageData(0, field / 2, bits * field, 1).data;
    let number = 0;
    for (let bit = 0; bit < bits; bit++) if (row[4 * (bit * field + field / 2)] > 128) number |= 1 << bit;
    const { width, height } = engine.shown();
    const Vector = engine.view.target.constructor;
    const places = points.map((point) => {
        const at = new Vector(...point).project(camera);
        return [((at.x + 1) / 2) * width, ((1 - at.y) / 2) * height];
    });
    return { number, places, width, height };
}"""


async def overlay_errors(screen: Screen, shots: list[Shot], points: list[tuple[float, float, float]]) -> list[float]:
    """Return the distance between the drawn and the true position of each point, m, measured at the point's depth.

    Return an empty list while the camera is not registered.
    """
    seen: dict[str, Any] | None = await screen.page.evaluate(_PROBE, [points, BITS, FIELD])
    if seen is None:
        return []
    true, depths = shots[seen["number"]].project(points)
    scale = max(seen["width"] / WIDTH, seen["height"] / HEIGHT)
    middle = np.array([WIDTH / 2, HEIGHT / 2])
    shown = (np.array(seen["places"]) - (seen["width"] / 2, seen["height"] / 2)) / scale + middle - 0.5
    errors: list[float] = (np.linalg.norm(shown - true, axis=1) * depths / FOCAL).tolist()
    return errors
