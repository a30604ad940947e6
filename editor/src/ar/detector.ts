/**
 * Find ArUco markers of 4 × 4 cells in a grey picture: dark patches with four straight sides, the bits of their cells,
 * and corners with sub-pixel accuracy.
 */

import { outerBorders, quadOf } from "./borders";
import { refined } from "./edges";
import { homography, type Point, type Quad } from "./geometry";
import { type Grey, half, sample } from "./grey";

/** A marker in a picture. Its corners are clockwise from the upper left one as printed. */
export interface DetectedMarker {
  id: number;
  corners: Quad;
}

/** Radius of the neighbourhood for the threshold, pixels of the half-size picture. */
const RADIUS = 14;
/** Minimum difference between a dark pixel and its neighbourhood. */
const DARKER = 7;
/** Smallest difference between white and black cells. */
const CONTRAST = 22;
/** Cells along a side, with the black frame. */
const CELLS = 6;
/** Places at which a cell is sampled. */
const SAMPLES = [0.35, 0.5, 0.65];

/** Return the markers in a picture. `codes`: 16 bits by id; bit 15 is the upper left cell, 1 is white. */
export function detect(picture: Grey, codes: ReadonlyMap<number, number>): DetectedMarker[] {
  const small = half(picture);
  const found = new Map<number, DetectedMarker & { contrast: number }>();
  for (const border of outerBorders(darkPixels(small))) {
    const quad = quadOf(border);
    if (!quad) continue;
    const outline = enlarged(quad);
    const read = decode(picture, outline, codes);
    if (!read) continue;
    const once = refined(picture, read.corners);
    const corners = once && (refined(picture, once) ?? once);
    const known = found.get(read.id);
    if (corners && !(known && known.contrast >= read.contrast)) found.set(read.id, { ...read, corners });
  }
  return [...found.values()].map(({ id, corners }) => ({ id, corners }));
}

/** Return 1 for each pixel that is darker than the mean of its neighbourhood; the outermost pixels are 0. */
function darkPixels({ data, width, height }: Grey): Grey {
  const stride = width + 1;
  const sums = new Int32Array(stride * (height + 1));
  for (let y = 0; y < height; y++) {
    let row = 0;
    for (let x = 0, i = y * width, k = (y + 1) * stride + 1; x < width; x++, i++, k++) {
      row += data[i] as number;
      sums[k] = (sums[k - stride] as number) + row;
    }
  }
  const dark = new Uint8Array(width * height);
  for (let y = 1; y < height - 1; y++) {
    const top = Math.max(0, y - RADIUS) * stride;
    const bottom = Math.min(height, y + RADIUS + 1) * stride;
    const rows = (bottom - top) / stride;
    for (let x = 1; x < width - 1; x++) {
      const left = Math.max(0, x - RADIUS);
      const right = Math.min(width, x + RADIUS + 1);
      const sum =
        (sums[bottom + right] as number) -
        (sums[top + right] as number) -
        (sums[bottom + left] as number) +
        (sums[top + left] as number);
      if (((data[y * width + x] as number) + DARKER) * rows * (right - left) < sum) dark[y * width + x] = 1;
    }
  }
  return { data: dark, width, height };
}

/** Return the outline in the full picture: borders are inside of dark pixels, so it is half a pixel further out. */
function enlarged(quad: Quad): Quad {
  const x = quad.reduce((sum, p) => sum + p[0], 0) / 4;
  const y = quad.reduce((sum, p) => sum + p[1], 0) / 4;
  return quad.map((p) => {
    const distance = Math.hypot(p[0] - x, p[1] - y) || 1;
    return [2 * (p[0] + (0.5 * (p[0] - x)) / distance) + 0.5, 2 * (p[1] + (0.5 * (p[1] - y)) / distance) + 0.5];
  }) as unknown as Quad;
}

/** Return the marker whose bits a quadrilateral has. One wrong cell is accepted, of the bits or of the frame. */
function decode(
  picture: Grey,
  quad: Quad,
  codes: ReadonlyMap<number, number>,
): { id: number; corners: Quad; contrast: number } | null {
  const cells = cellsOf(picture, quad);
  const low = Math.min(...cells);
  const contrast = Math.max(...cells) - low;
  if (contrast < CONTRAST) return null;
  const middle = low + contrast / 2;
  const white = (row: number, column: number) => (cells[row * CELLS + column] as number) > middle;
  let wrong = 0;
  for (let k = 0; k < CELLS; k++) {
    wrong += Number(white(0, k)) + Number(white(CELLS - 1, k));
    if (k > 0 && k < CELLS - 1) wrong += Number(white(k, 0)) + Number(white(k, CELLS - 1));
  }
  if (wrong > 1) return null;
  for (let turn = 0; turn < 4; turn++) {
    let bits = 0;
    for (let r = 0; r < 4; r++) {
      for (let c = 0; c < 4; c++) {
        // The cell of the picture for row r and column c of the marker, turned clockwise.
        const [row, column] = (
          [
            [r, c],
            [c, 3 - r],
            [3 - r, 3 - c],
            [3 - c, r],
          ] as const
        )[turn] as readonly [number, number];
        bits = bits * 2 + Number(white(row + 1, column + 1));
      }
    }
    for (const [id, code] of codes) {
      if (ones(bits ^ code) + wrong > 1) continue;
      const corners = [0, 1, 2, 3].map((k) => quad[(k + turn) & 3] as Point) as unknown as Quad;
      return { id, corners, contrast };
    }
  }
  return null;
}

function cellsOf(picture: Grey, quad: Quad): number[] {
  const h = homography(quad) as [number, number, number, number, number, number, number, number, number];
  const cells: number[] = [];
  for (let row = 0; row < CELLS; row++) {
    for (let column = 0; column < CELLS; column++) {
      let sum = 0;
      for (const dv of SAMPLES) {
        for (const du of SAMPLES) {
          const u = (column + du) / CELLS;
          const v = (row + dv) / CELLS;
          const z = h[6] * u + h[7] * v + 1;
          sum += sample(picture, (h[0] * u + h[1] * v + h[2]) / z, (h[3] * u + h[4] * v + h[5]) / z);
        }
      }
      cells.push(sum / (SAMPLES.length * SAMPLES.length));
    }
  }
  return cells;
}

function ones(bits: number): number {
  let count = 0;
  for (let left = bits; left; left &= left - 1) count++;
  return count;
}
