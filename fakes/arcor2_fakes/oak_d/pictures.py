"""Images of an instant: rendered when the scene has changed; noise is added once for each of its variants."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from arcor2_fakes.oak_d.optics import Lens
from arcor2_fakes.oak_d.scene import Scene

JPEG_QUALITY = 90


class Pictures:
    """Renders images on the calling thread, one at a time."""

    def __init__(self, lens: Lens, noise: float, seed: int) -> None:
        self._lens, self._noise, self._seed = lens, noise, seed
        self._one = threading.Lock()
        self._renderer: Any = None
        self._sensor: Any = None
        self._version = -1
        self._view: Any = None
        self._done: dict[tuple[Any, ...], bytes] = {}
        self.rendered = 0

    def take(self, scene: Scene, number: int, exposure: float, covered: bool) -> tuple[Callable[[str], bytes], bytes]:
        """Return the colour image, coded as bgr or jpeg, and the depth image.

        Raises:
            ValueError: An object of the scene cannot be rendered.
        """
        from arcor2_fakes.oak_d import sensor

        self.warm()
        with self._one:
            self._look(scene)

            variant = number % sensor.VARIANTS
            if (key := ("depth", variant, covered)) not in self._done:
                self._done[key] = self._sensor.depth(self._view, variant, covered).tobytes()
            if (base := ("bgr", variant, exposure, covered)) not in self._done:
                if len(self._done) > 4 * sensor.VARIANTS:
                    self._done = {key: self._done[key]}
                self._done[base] = self._sensor.color(self._view, variant, exposure, covered).tobytes()
            bgr, depth = self._done[base], self._done[key]

        def color(form: str) -> bytes:
            return bgr if form == "bgr" else self._jpeg((*base, form), bgr)

        return color, depth

    def warm(self) -> None:
        """Load Open3D before the first image is needed: it takes 1 s, or 3 s on a busy machine."""
        from arcor2_fakes.oak_d import render, sensor

        with self._one:
            if self._renderer is None:
                self._sensor = sensor.Sensor(self._lens.width, self._lens.height, self._noise, self._seed)
                self._renderer = render.Renderer(self._lens)

    def _look(self, scene: Scene) -> None:
        version = scene.version
        if version != self._version:
            self._view = self._renderer.view(scene.camera, scene.table_height, scene.things)
            self._version = version
            self._done.clear()
            self.rendered += 1

    def _jpeg(self, key: tuple[Any, ...], bgr: bytes) -> bytes:
        import cv2
        import numpy as np

        with self._one:
            if key not in self._done:
                picture = np.frombuffer(bgr, np.uint8).reshape(self._lens.height, self._lens.width, 3)
                self._done[key] = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes()
            return self._done[key]
