"""Rendered camera pictures of markers and boards, by ray casting: reference data for calibrations.

The ray of every pixel is computed from the lens model, inverted by Newton's method. Its intersection with a printed
plate is computed in the plate's frame, and the print is sampled at 16 positions around it. Nothing is projected, and
no code of the solver or of OpenCV's geometry is used, except the bits of the marker dictionaries. The picture then gets
light that falls off to one side, blur of lens and defocus, the tone curve of a camera, noise, and 8-bit quantization.

Not modelled: depth (plates are painted in the given order), shadows, reflections, rolling shutter, colour filters.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

SUBPIXELS: Final = 4
WHITE, BLACK, TABLE = 0.85, 0.06, 0.32  # reflectance


@dataclass(frozen=True)
class Lens:
    """Lens: fx, fy, cx, cy in px, and the first coefficients of k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4."""

    fx: float
    fy: float
    cx: float
    cy: float
    coefficients: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    width: int = 1280
    height: int = 720


@dataclass(frozen=True, eq=False)
class Plate:
    """A flat printed plate.

    Attributes:
        world_from_plate: 4 × 4; the origin is the center of the plate, x right, y up, z out of it.
        cells: Reflectance, rows from the top, columns from the left.
        cell: Side of a cell, m.
    """

    world_from_plate: Array
    cells: Array
    cell: float

    @property
    def size(self) -> tuple[float, float]:
        """Width and height, m."""
        return self.cells.shape[1] * self.cell, self.cells.shape[0] * self.cell


@dataclass(frozen=True)
class Exposure:
    """Exposure of a picture.

    Attributes:
        blur: Standard deviation, px.
        noise: Standard deviation, grey levels.
        light: Brightness of a white sheet; 1 saturates.
        falloff: Share of the light that is missing at one side.
        srgb: Apply the sRGB tone curve; otherwise linear, as from a bare sensor.
    """

    blur: float = 0.8
    noise: float = 2.0
    light: float = 1.0
    falloff: float = 0.2
    srgb: bool = True


# ------------------------------------------------------------------------------------------------ plates
def marker(number: int, size: float, world_from_marker: Array, dictionary: int = cv2.aruco.DICT_4X4_50) -> Plate:
    """Return a marker with a white margin as wide as a cell; `size` is the side of its black square, m."""
    bits = _bits(number, dictionary)
    return Plate(world_from_marker, np.pad(bits, 1, constant_values=WHITE), size / len(bits))


def charuco(columns: int, rows: int, cell: float, world_from_board: Array) -> Plate:
    """Return a board with squares of 8 cells, markers of 6 cells (4x4_50 from number 0), and a margin of 4 cells."""
    board = np.full((rows * 8, columns * 8), WHITE)
    number = 0
    for row in range(rows):
        for column in range(columns):
            top, left = row * 8, column * 8
            if (row + column) % 2 == 0:
                board[top : top + 8, left : left + 8] = BLACK
            else:
                board[top + 1 : top + 7, left + 1 : left + 7] = _bits(number, cv2.aruco.DICT_4X4_50)
                number += 1
    return Plate(world_from_board, np.pad(board, 4, constant_values=WHITE), cell)


def table(random: np.random.Generator, side: float = 6.0, grain: float = 0.008) -> Plate:
    """Return a speckled table at z = 0."""
    count = int(side / grain)
    return Plate(np.eye(4), np.clip(random.normal(TABLE, 0.06, (count, count)), 0.02, 0.9), grain)


@functools.cache
def _bits(number: int, dictionary: int) -> Array:
    """Return the cells of a marker, including its black border."""
    known = cv2.aruco.getPredefinedDictionary(dictionary)
    side = known.markerSize + 2
    return np.where(cv2.aruco.generateImageMarker(known, number, side) > 127, WHITE, BLACK).astype(np.float64)


# ------------------------------------------------------------------------------------------------ rays
def distorted(x: Array, y: Array, coefficients: tuple[float, ...]) -> tuple[Array, Array]:
    """Return the distorted coordinates of a ray through (x, y) at distance 1."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = (*coefficients, *(0.0,) * (12 - len(coefficients)))
    q = x * x + y * y
    radial = (1.0 + q * (k1 + q * (k2 + q * k3))) / (1.0 + q * (k4 + q * (k5 + q * k6)))
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (q + 2.0 * x * x) + q * (s1 + q * s2),
        y * radial + 2.0 * p2 * x * y + p1 * (q + 2.0 * y * y) + q * (s3 + q * s4),
    )


@functools.lru_cache(maxsize=4)
def rays(lens: Lens) -> Array:
    """Return x and y at distance 1 for the center of every pixel, with a margin of one: rows + 2, columns + 2, 2."""
    u, v = np.meshgrid(np.arange(-1.0, lens.width + 1), np.arange(-1.0, lens.height + 1))
    aim_x, aim_y = (u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy
    x, y = aim_x.copy(), aim_y.copy()
    step = 1e-6
    for _ in range(30):
        at_x, at_y = distorted(x, y, lens.coefficients)
        right_x, right_y = distorted(x + step, y, lens.coefficients)
        up_x, up_y = distorted(x, y + step, lens.coefficients)
        a, b, c, d = (right_x - at_x) / step, (up_x - at_x) / step, (right_y - at_y) / step, (up_y - at_y) / step
        miss_x, miss_y = aim_x - at_x, aim_y - at_y
        determinant = a * d - b * c
        x += (d * miss_x - b * miss_y) / determinant
        y += (a * miss_y - c * miss_x) / determinant
        if max(np.abs(miss_x).max(), np.abs(miss_y).max()) < 1e-11:
            return np.stack((x, y), axis=-1)
    raise ValueError("The distortion is not invertible: some pixels have no ray.")


def _intersections(plate: Plate, world_from_camera: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Return the intersections of rays with a plate in its frame, m; NaN for rays that miss it or meet its back."""
    plate_from_camera = np.linalg.inv(plate.world_from_plate) @ world_from_camera
    r, eye = plate_from_camera[:3, :3], plate_from_camera[:3, 3]
    if eye[2] <= 0:
        return np.full_like(x, np.nan), np.full_like(x, np.nan)
    along = r[2, 0] * x + r[2, 1] * y + r[2, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(along < 0, -eye[2] / along, np.nan)
    return (
        eye[0] + distance * (r[0, 0] * x + r[0, 1] * y + r[0, 2]),
        eye[1] + distance * (r[1, 0] * x + r[1, 1] * y + r[1, 2]),
    )


def _box(plate: Plate, world_from_camera: Array, lens: Lens) -> tuple[slice, slice] | None:
    """Return the part of the picture (with its margin of one) that can show a plate."""
    coarse = 8
    grid = rays(lens)[::coarse, ::coarse]
    x, y = _intersections(plate, world_from_camera, grid[..., 0], grid[..., 1])
    width, height = plate.size
    with np.errstate(invalid="ignore"):
        seen = (np.abs(x) < 0.6 * width) & (np.abs(y) < 0.6 * height)
    rows, columns = np.nonzero(seen)
    if not len(rows):
        return None
    top, left = max(int(rows.min() - 3) * coarse, 1), max(int(columns.min() - 3) * coarse, 1)
    bottom = min(int(rows.max() + 4) * coarse, lens.height + 1)
    right = min(int(columns.max() + 4) * coarse, lens.width + 1)
    return slice(top, bottom), slice(left, right)


def _paint(picture: Array, plate: Plate, world_from_camera: Array, lens: Lens, subpixels: int) -> None:
    """Paint a plate into a picture of reflectances."""
    box = _box(plate, world_from_camera, lens)
    if box is None:
        return
    rows, columns = box
    grid = rays(lens)[rows.start - 1 : rows.stop + 1, columns.start - 1 : columns.stop + 1]
    margin_x, margin_y = _intersections(plate, world_from_camera, grid[..., 0], grid[..., 1])
    x, y = margin_x[1:-1, 1:-1], margin_y[1:-1, 1:-1]
    # Within a pixel, the position on the plate is interpolated from the neighbouring pixels.
    x_by_u, y_by_u = ((at[1:-1, 2:] - at[1:-1, :-2]) / 2 for at in (margin_x, margin_y))
    x_by_v, y_by_v = ((at[2:, 1:-1] - at[:-2, 1:-1]) / 2 for at in (margin_x, margin_y))
    width, height = plate.size
    # Divide a cell so that its edge, where values change linearly, is as wide as the distance between samples.
    pixel = float(np.nanmedian(np.hypot(x_by_u, y_by_u)))
    fine = int(np.clip(plate.cell / pixel * subpixels, 1, 256)) if subpixels > 1 else 1
    target = picture[rows.start - 1 : rows.stop - 1, columns.start - 1 : columns.stop - 1]
    with np.errstate(invalid="ignore"):
        reached = np.nonzero((np.abs(x) < width / 2 + 2 * pixel) & (np.abs(y) < height / 2 + 2 * pixel))
    x, y, x_by_u, y_by_u, x_by_v, y_by_v = (each[reached] for each in (x, y, x_by_u, y_by_u, x_by_v, y_by_v))
    total, weight = np.zeros(len(x)), np.zeros(len(x))
    for j in range(subpixels):
        for i in range(subpixels):
            du, dv = (i + 0.5) / subpixels - 0.5, (j + 0.5) / subpixels - 0.5
            at_x, at_y = x + du * x_by_u + dv * x_by_v, y + du * y_by_u + dv * y_by_v
            inside = (np.abs(at_x) <= width / 2) & (np.abs(at_y) <= height / 2)
            total += np.where(inside, _printed(plate, at_x, at_y, fine), 0.0)
            weight += inside
    target[reached] = target[reached] * (1 - weight / subpixels**2) + total / subpixels**2


def _printed(plate: Plate, x: Array, y: Array, fine: int) -> Array:
    """Return the reflectance at points; edges are 1 / `fine` of a cell wide."""
    rows, columns = plate.cells.shape
    right, down = x / plate.cell + columns / 2, rows / 2 - y / plate.cell
    column = np.clip(right.astype(np.int32), 0, columns - 1)
    row = np.clip(down.astype(np.int32), 0, rows - 1)
    values: Array = plate.cells[row, column]
    part_x, part_y = right - column, down - row
    edge = 0.5 / fine
    near = np.nonzero((np.abs(part_x - 0.5) > 0.5 - edge) | (np.abs(part_y - 0.5) > 0.5 - edge))[0]
    left, part_x = _between(right[near], columns, fine)
    upper, part_y = _between(down[near], rows, fine)
    after, lower = np.minimum(left + 1, columns - 1), np.minimum(upper + 1, rows - 1)
    above = plate.cells[upper, left] * (1 - part_x) + plate.cells[upper, after] * part_x
    below = plate.cells[lower, left] * (1 - part_x) + plate.cells[lower, after] * part_x
    values[near] = above * (1 - part_y) + below * part_y
    return values


def _between(at: Array, count: int, fine: int) -> tuple[npt.NDArray[np.int32], Array]:
    """Return the cell before the nearest edge, and the weight of the next cell, 0 to 1."""
    edge = np.rint(at)
    part = np.clip((at - edge) * fine + 0.5, 0.0, 1.0)
    before = (edge - 1).astype(np.int32)
    # The border of the plate is not an edge.
    part = np.where(before < 0, 1.0, part)
    part = np.where(before >= count - 1, 0.0, part)
    return np.clip(before, 0, count - 1), part


# ------------------------------------------------------------------------------------------------ pictures
def render(
    lens: Lens,
    world_from_camera: Array,
    plates: Sequence[Plate],
    random: np.random.Generator,
    exposure: Exposure = Exposure(),
    subpixels: int = SUBPIXELS,
) -> npt.NDArray[np.uint8]:
    """Render a picture: grey values, rows × columns. The first plate is the background, sampled once per pixel.

    The other plates are sampled `subpixels` × `subpixels` times per pixel.
    """
    reflectance = np.full((lens.height, lens.width), TABLE)
    for index, plate in enumerate(plates):
        _paint(reflectance, plate, world_from_camera, lens, subpixels if index else 1)
    side = np.linspace(1.0 - exposure.falloff, 1.0, lens.width)
    light = reflectance * side[None, :] * exposure.light
    if exposure.blur > 0:
        blurred = cv2.GaussianBlur(light, (0, 0), exposure.blur, borderType=cv2.BORDER_REPLICATE)
        light = blurred.astype(np.float64)
    light = np.clip(light, 0.0, 1.0)
    if exposure.srgb:
        light = np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.power(light, 1 / 2.4) - 0.055)
    return np.clip(np.rint(light * 255.0 + random.normal(0.0, exposure.noise, light.shape)), 0, 255).astype(np.uint8)


def looking_at(eye: Array, target: Array, roll: float) -> Array:
    """Return world_from_camera of a camera at `eye` that looks at `target`, turned about its optical axis by `roll`."""
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, (0.0, 0.0, 1.0) if abs(z[2]) < 0.99 else (0.0, 1.0, 0.0))
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    pose = np.eye(4)
    c, s = np.cos(roll), np.sin(roll)
    pose[:3, :3] = np.column_stack((c * x + s * y, c * y - s * x, z))
    pose[:3, 3] = eye
    return pose
