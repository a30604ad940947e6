"""The sensor: adds noise, exposure and the errors of lens and stereo matching to a rendered view."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from arcor2_fakes.oak_d.render import Bytes, View

NORMAL_EXPOSURE: Final = 0.01
"""Exposure time at which an image is as bright as the scene, s."""
DEPTH_RANGE: Final = (0.2, 10.0)
"""Depth range of a stereo pair with extended disparity, m."""
DEPTH_NOISE: Final = 0.0018
"""Standard deviation of depth at 1 m, m; it grows with the square of the distance, as for stereo."""
COLOR_NOISE: Final = 2.0
VARIANTS: Final = 6
"""Number of noise patterns; an unchanged scene is rendered once with each."""
HOLES: Final = 0.003
"""Fraction of pixels without depth at random."""
EDGE: Final = 0.02
"""Depth difference between neighbours above which half of the pixels have no depth, m."""


class Sensor:
    """Converts views of one size to images. Not thread-safe."""

    def __init__(self, width: int, height: int, noise: float, seed: int) -> None:
        rng = np.random.default_rng(seed)
        shape = (height, width)
        self._depth_noise = [
            (rng.standard_normal(shape, np.float32) * np.float32(DEPTH_NOISE * noise)) for _ in range(VARIANTS)
        ]
        self._color_noise = [
            np.rint(rng.standard_normal((*shape, 3), np.float32) * np.float32(COLOR_NOISE * noise)).astype(np.int8)
            for _ in range(VARIANTS)
        ]
        self._holes = [rng.random(shape, np.float32) < HOLES * min(noise, 1.0) for _ in range(VARIANTS)]
        self._coin = rng.random(shape, np.float32) < 0.5 * min(noise, 1.0)

    def color(self, view: View, variant: int, exposure: float, covered: bool) -> Bytes:
        """Return the colour image, B, G, R."""
        if covered:
            base: npt.NDArray[np.int16] = np.full(view.color.shape, 4, np.int16)
        elif exposure == NORMAL_EXPOSURE:
            base = view.color.astype(np.int16)
        else:
            factor = exposure / NORMAL_EXPOSURE
            base = np.minimum(view.color.astype(np.float32) * np.float32(factor), 1000.0).astype(np.int16)
        base += self._color_noise[variant % VARIANTS]
        return np.asarray(np.clip(base, 0, 255), dtype=np.uint8)

    def depth(self, view: View, variant: int, covered: bool) -> npt.NDArray[np.uint16]:
        """Return the depth image, mm, 0 where there is none."""
        z = view.depth
        if covered:
            return np.zeros(z.shape, np.uint16)
        kernel = np.ones((3, 3), np.uint8)
        edge = (cv2.dilate(z, kernel) - cv2.erode(z, kernel)) > EDGE
        nothing = (z < DEPTH_RANGE[0]) | (z > DEPTH_RANGE[1]) | self._holes[variant % VARIANTS] | (edge & self._coin)
        seen = z + z * z * self._depth_noise[variant % VARIANTS]
        return np.where(nothing, 0.0, np.rint(seen * np.float32(1000.0))).astype("<u2")
