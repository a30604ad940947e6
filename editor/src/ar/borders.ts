/** Borders of dark patches, and the quadrilaterals among them. */

import { area, type Point, type Quad } from "./geometry";
import type { Grey } from "./grey";

/** Points of a closed border: x, y, x, y … */
type Border = readonly number[];

/** Fewest and most points of a border. */
const SHORTEST = 30;
const LONGEST = 6000;
/** Smallest distance between the two corners that are farthest from each other, and of others from a line, pixels. */
const MIN_SIDE = 10;
const THINNEST = 3;
/** Smallest area, pixels². */
const SMALLEST = 60;
/** Part of the border that may be away from the sides, for instance where something covers an edge. */
const AWAY = 0.12;
/** Neighbours of a pixel, clockwise from the right. */
const DX: readonly number[] = [1, 1, 0, -1, -1, -1, 0, 1];
const DY: readonly number[] = [0, 1, 1, 1, 0, -1, -1, -1];

/** Return the borders of patches of pixels that are 1. The outermost pixels must be 0. */
export function outerBorders({ data, width, height }: Grey): Border[] {
  const seen = new Uint8Array(width * height);
  const found: Border[] = [];
  for (let y = 1; y < height - 1; y++) {
    for (let x = 1, i = y * width + 1; x < width - 1; x++, i++) {
      if (!data[i] || data[i - 1] || seen[i]) continue;
      const border = follow(data, width, x, y, seen);
      if (border.length >= 2 * SHORTEST) found.push(border);
    }
  }
  return found;
}

/** Follow the border of a patch clockwise from a pixel at its left side. */
function follow(data: Uint8Array, width: number, startX: number, startY: number, seen: Uint8Array): number[] {
  const border: number[] = [];
  let [x, y, direction, first] = [startX, startY, 6, -1];
  while (border.length < 2 * LONGEST) {
    border.push(x, y);
    seen[y * width + x] = 1;
    let next = (direction + 5) & 7;
    let tried = 0;
    while (tried < 8 && !data[(y + (DY[next] as number)) * width + x + (DX[next] as number)]) {
      next = (next + 1) & 7;
      tried++;
    }
    if (tried === 8) break; // a single pixel
    if (first < 0) {
      first = next;
    } else if (x === startX && y === startY && next === first) {
      border.length -= 2;
      break;
    }
    x += DX[next] as number;
    y += DY[next] as number;
    direction = next;
  }
  return border;
}

/** Return the corners of a border with four straight sides, clockwise on the screen; null for other borders. */
export function quadOf(border: Border): Quad | null {
  // Each of these is a corner of a convex shape. The last one is opposite of the side of the triangle that it exceeds.
  const a = farthest(border, (p) => distance(p, pointOf(border, 0)));
  const b = farthest(border, (p) => distance(p, a));
  if (distance(a, b) < MIN_SIDE) return null;
  const c = farthest(border, (p) => Math.abs(outside(p, a, b)));
  const triangle = outside(c, a, b) > 0 ? [a, c, b] : [a, b, c];
  const sides = triangle.map((p, k): [Point, Point] => [p, triangle[(k + 1) % 3] as Point]);
  const beyond = (p: Point) => Math.max(...sides.map(([from, to]) => outside(p, from, to)));
  const d = farthest(border, beyond);
  if (Math.abs(outside(c, a, b)) < THINNEST || beyond(d) < THINNEST) return null;
  const quad = sides.flatMap(([from, to]) => (outside(d, from, to) === beyond(d) ? [from, d] : [from]));
  const found = quad as unknown as Quad;
  return area(found) >= SMALLEST && isConvex(found) && hasStraightSides(border, found) ? found : null;
}

const pointOf = (border: Border, i: number): Point => [border[i] as number, border[i + 1] as number];

const distance = (p: Point, q: Point) => Math.hypot(p[0] - q[0], p[1] - q[1]);

/** Return the distance of a point from a line, positive on its left side: outside of a clockwise shape. */
const outside = (p: Point, from: Point, to: Point) =>
  ((to[1] - from[1]) * (p[0] - from[0]) - (to[0] - from[0]) * (p[1] - from[1])) / distance(from, to);

/** Return the point of a border with the largest measure. */
function farthest(border: Border, measure: (point: Point) => number): Point {
  let best = pointOf(border, 0);
  let most = Number.NEGATIVE_INFINITY;
  for (let i = 0; i < border.length; i += 2) {
    const point = pointOf(border, i);
    const value = measure(point);
    if (value > most) [most, best] = [value, point];
  }
  return best;
}

function isConvex(quad: Quad): boolean {
  return quad.every((p, k) => {
    const q = quad[(k + 1) & 3] as Point;
    const r = quad[(k + 2) & 3] as Point;
    return (q[0] - p[0]) * (r[1] - q[1]) - (q[1] - p[1]) * (r[0] - q[0]) > 0;
  });
}

/** Return whether nearly all of the border is close to the sides. */
function hasStraightSides(border: Border, quad: Quad): boolean {
  const tolerance = Math.max(2, (0.03 * border.length) / 8);
  const sides = quad.map((p, k) => {
    const q = quad[(k + 1) & 3] as Point;
    const length = Math.hypot(q[0] - p[0], q[1] - p[1]);
    return [p[0], p[1], (q[0] - p[0]) / length, (q[1] - p[1]) / length] as const;
  });
  let away = 0;
  let checked = 0;
  for (let i = 0; i < border.length; i += 4) {
    const [x, y] = pointOf(border, i);
    checked++;
    if (sides.every(([px, py, dx, dy]) => Math.abs(dx * (y - py) - dy * (x - px)) > tolerance)) away++;
  }
  return away <= checked * AWAY;
}
