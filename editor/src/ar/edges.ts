/** Corners with sub-pixel accuracy: each side is a line through the places where the brightness changes across it. */

import type { Point, Quad } from "./geometry";
import { type Grey, sample } from "./grey";

/** Part of a side that is used: the corners blur. */
const USED = 0.8;
/** Largest correction of a corner, pixels. */
const FARTHEST = 6;

interface Line {
  /** Normal, and its product with a point of the line. */
  nx: number;
  ny: number;
  offset: number;
}

/** Return the corners of a dark quadrilateral on a white background; null if an edge is not visible. */
export function refined(picture: Grey, corners: Quad): Quad | null {
  const lines: Line[] = [];
  for (let k = 0; k < 4; k++) {
    const places = edgePlaces(picture, corners[k] as Point, corners[(k + 1) & 3] as Point);
    if (places.length < 5) return null;
    lines.push(lineThrough(places));
  }
  const found: Point[] = [];
  for (let k = 0; k < 4; k++) {
    const corner = crossing(lines[(k + 3) & 3] as Line, lines[k] as Line);
    const before = corners[k] as Point;
    if (!corner || Math.hypot(corner[0] - before[0], corner[1] - before[1]) > FARTHEST) return null;
    found.push(corner);
  }
  return found as unknown as Quad;
}

/** Return the places of the edge between two corners: the centre of the change of brightness across it. */
function edgePlaces(picture: Grey, from: Point, to: Point): Point[] {
  const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
  const [tx, ty] = [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
  const [nx, ny] = [ty, -tx]; // outwards, where the paper is white
  const reach = Math.max(2, Math.min(5, length / 10));
  const count = Math.max(8, Math.min(40, Math.round(length * USED)));
  const places: Point[] = [];
  for (let i = 0; i < count; i++) {
    const along = length * ((1 - USED) / 2 + (USED * (i + 0.5)) / count);
    const [x, y] = [from[0] + tx * along, from[1] + ty * along];
    let [weight, moment] = [0, 0];
    let last = sample(picture, x - nx * reach, y - ny * reach);
    for (let e = -reach + 0.5; e <= reach + 1e-9; e += 0.5) {
      const value = sample(picture, x + nx * e, y + ny * e);
      const rise = Math.max(0, value - last - 0.5);
      weight += rise;
      moment += rise * (e - 0.25);
      last = value;
    }
    if (weight > 12) places.push([x + (nx * moment) / weight, y + (ny * moment) / weight]);
  }
  return places;
}

/** Return the line through most of the points; points far away from it, such as those of a finger, do not count. */
function lineThrough(points: readonly Point[]): Line {
  let weights = points.map(() => 1);
  let line: Line = { nx: 1, ny: 0, offset: 0 };
  for (let round = 0; round < 4; round++) {
    let [sum, cx, cy, xx, xy, yy] = [0, 0, 0, 0, 0, 0];
    points.forEach(([x, y], i) => {
      const w = weights[i] as number;
      sum += w;
      cx += w * x;
      cy += w * y;
    });
    cx /= sum;
    cy /= sum;
    points.forEach(([x, y], i) => {
      const w = weights[i] as number;
      xx += w * (x - cx) ** 2;
      xy += w * (x - cx) * (y - cy);
      yy += w * (y - cy) ** 2;
    });
    const angle = 0.5 * Math.atan2(2 * xy, xx - yy);
    const [nx, ny] = [-Math.sin(angle), Math.cos(angle)];
    line = { nx, ny, offset: nx * cx + ny * cy };
    const errors = points.map(([x, y]) => Math.abs(nx * x + ny * y - line.offset));
    const median = [...errors].sort((a, b) => a - b)[errors.length >> 1] as number;
    weights = errors.map((error) => (error < 2.5 * (1.48 * median + 0.02) ? 1 : 0));
  }
  return line;
}

function crossing(a: Line, b: Line): Point | null {
  const divisor = a.nx * b.ny - a.ny * b.nx;
  if (Math.abs(divisor) < 0.1) return null;
  return [(a.offset * b.ny - b.offset * a.ny) / divisor, (a.nx * b.offset - b.nx * a.offset) / divisor];
}
