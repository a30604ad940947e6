/** The pose of the camera from corners of markers at known places: all corners in one least-squares problem. */

import type { DetectedMarker } from "./detector";
import {
  add,
  apply,
  area,
  cross,
  dot,
  homography,
  type Mat3,
  mean,
  multiply,
  norm,
  type Point,
  type Quad,
  rotation,
  scale,
  solve,
  sub,
  transposed,
  unit,
  type Vec3,
} from "./geometry";

/** Focal length and principal point, pixels. Pictures of phones and tablets have no noticeable distortion. */
export interface Lens {
  focal: number;
  cx: number;
  cy: number;
}

/** A marker of the workplace. Its corners, m, are clockwise from the upper left one as seen from the front. */
export interface Place {
  corners: readonly [Vec3, Vec3, Vec3, Vec3];
  size: number;
}

export type Places = ReadonlyMap<number, Place>;

/** The camera in the workplace: `camera = turn * world + shift`. Camera frame: x right, y down, z forward. */
export interface View {
  turn: Mat3;
  shift: Vec3;
}

/** A view that fits to markers. */
export interface FittedView extends View {
  /** Root mean square of the distances between seen and expected corners, pixels. */
  rms: number;
  /** Number of corners. */
  corners: number;
  /** Information matrix of small rotations and shifts of the camera, for errors of one pixel. */
  information: number[][];
  /** Error of the best view relative to the second best one; above about 0.5, the second one is possible too. */
  ambiguity: number;
}

interface Match {
  world: Vec3;
  seen: Point;
}

/** Distance between two views that are different answers, m. */
const DISTINCT = 0.02;
/** Smallest distance of a corner in front of the camera, m. */
const NEAREST = 0.02;
const ROUNDS = 15;

/** Return the position of the camera, m. */
export const eyeOf = ({ turn, shift }: View): Vec3 => scale(apply(transposed(turn), shift), -1);

/** Return where a point of the workplace is in the picture, pixels; null behind the camera. */
export function projected(world: Vec3, { turn, shift }: View, lens: Lens): Point | null {
  const [x, y, z] = add(apply(turn, world), shift);
  if (z < NEAREST) return null;
  return [(lens.focal * x) / z + lens.cx, (lens.focal * y) / z + lens.cy];
}

/** Return the squared distances of the corners of a marker from where they are expected, pixels². */
export function markerError({ corners }: DetectedMarker, place: Place, view: View, lens: Lens): number {
  let sum = 0;
  corners.forEach((seen, i) => {
    const expected = projected(place.corners[i] as Vec3, view, lens);
    sum += expected ? (expected[0] - seen[0]) ** 2 + (expected[1] - seen[1]) ** 2 : Number.POSITIVE_INFINITY;
  });
  return sum;
}

/**
 * Return the view that fits best to markers, null without one. A flat marker permits two views, so both are tried;
 * with `near`, only views close to it.
 */
export function fitView(seen: readonly DetectedMarker[], places: Places, lens: Lens, near?: View): FittedView | null {
  const known = seen.filter(({ id }) => places.has(id));
  const matches = known.flatMap(({ id, corners }) =>
    corners.map((corner, i): Match => ({ world: (places.get(id) as Place).corners[i] as Vec3, seen: corner })),
  );
  const largest = [...known].sort((a, b) => area(b.corners) - area(a.corners))[0];
  if (!largest) return null;
  const starts = near ? [near] : startsFrom(largest.corners, places.get(largest.id) as Place, lens);
  const found = starts
    .map((start) => descend(start, matches, lens))
    .filter(({ rms }) => Number.isFinite(rms))
    .sort((a, b) => a.rms - b.rms);
  const best = found[0];
  if (!best) return null;
  const rival = found.find((each) => norm(sub(eyeOf(each), eyeOf(best))) > DISTINCT);
  return { ...best, ambiguity: rival ? best.rms / Math.max(rival.rms, 1e-9) : 0 };
}

/** Return the two views from which a marker looks nearly the same. */
function startsFrom(corners: Quad, place: Place, lens: Lens): View[] {
  const h = homography(
    corners.map(([x, y]) => [(x - lens.cx) / lens.focal, (y - lens.cy) / lens.focal]) as unknown as Quad,
  ) as [number, number, number, number, number, number, number, number, number];
  const right: Vec3 = [h[0], h[3], h[6]];
  const down: Vec3 = [h[1], h[4], h[7]];
  const origin: Vec3 = [h[2], h[5], h[8]];
  const size = Math.sqrt(norm(right) * norm(down));
  const x = unit(right);
  const y = unit(sub(scale(down, -1), scale(x, -dot(down, x))));
  const middle = scale(add(origin, scale(add(right, down), 0.5)), place.size / size);
  const seen: Mat3 = transposed([x, y, cross(x, y)]);
  const [upperLeft, upperRight, , lowerLeft] = place.corners;
  const across = unit(sub(upperRight, upperLeft));
  const up = unit(sub(upperLeft, lowerLeft));
  const frame: Mat3 = [across, up, cross(across, up)];
  const centre = mean(place.corners);
  return [seen, mirrored(seen, middle)].map((each) => {
    const turn = multiply(each, frame);
    return { turn, shift: sub(middle, apply(turn, centre)) };
  });
}

/** Return the orientation of a marker whose normal is mirrored at the line of sight. */
function mirrored(seen: Mat3, middle: Vec3): Mat3 {
  const sight = unit(middle);
  const normal: Vec3 = [seen[0][2], seen[1][2], seen[2][2]];
  const other = sub(scale(sight, 2 * dot(sight, normal)), normal);
  const axis = cross(normal, other);
  const sine = norm(axis);
  if (sine < 1e-6) return seen;
  return multiply(rotation(scale(axis, Math.atan2(sine, dot(normal, other)) / sine)), seen);
}

/** Improve a view by the method of Levenberg and Marquardt. */
function descend(start: View, matches: readonly Match[], lens: Lens): FittedView {
  let view = start;
  let cost = costOf(view, matches, lens);
  let damping = 1e-4;
  let information = zeros();
  for (let round = 0; round < ROUNDS && Number.isFinite(cost); round++) {
    const { matrix, gradient } = linearised(view, matches, lens);
    information = matrix;
    const damped = matrix.map((row, i) => row.map((value, j) => (i === j ? value * (1 + damping) : value)));
    const step = solve(damped, gradient);
    if (!step) break;
    const next = moved(view, step);
    const less = costOf(next, matches, lens);
    if (less < cost) {
      const done = cost - less < 1e-9 * cost;
      [view, cost, damping] = [next, less, Math.max(1e-9, damping / 10)];
      if (done) break;
    } else {
      damping *= 10;
      if (damping > 1e6) break;
    }
  }
  const corners = matches.length;
  return { ...view, rms: Math.sqrt(cost / corners), corners, information, ambiguity: 0 };
}

/** Return a view after a small rotation and shift of the camera. */
export function moved({ turn, shift }: View, step: readonly number[]): View {
  const [a, b, c, x, y, z] = step as [number, number, number, number, number, number];
  return { turn: multiply(rotation([a, b, c]), turn), shift: add(shift, [x, y, z]) };
}

function costOf(view: View, matches: readonly Match[], lens: Lens): number {
  let sum = 0;
  for (const { world, seen } of matches) {
    const expected = projected(world, view, lens);
    if (!expected) return Number.POSITIVE_INFINITY;
    sum += (expected[0] - seen[0]) ** 2 + (expected[1] - seen[1]) ** 2;
  }
  return sum;
}

/** Return how the place of a point in the picture depends on a small rotation and shift of the camera: two rows. */
export function dependence(world: Vec3, { turn, shift }: View, lens: Lens): [number[], number[]] {
  const rotated = apply(turn, world);
  const [x, y, z] = add(rotated, shift);
  const k = lens.focal / z;
  const horizontal: Vec3 = [k, 0, (-k * x) / z];
  const vertical: Vec3 = [0, k, (-k * y) / z];
  return [
    [...cross(rotated, horizontal), ...horizontal],
    [...cross(rotated, vertical), ...vertical],
  ];
}

function linearised(view: View, matches: readonly Match[], lens: Lens): { matrix: number[][]; gradient: number[] } {
  const matrix = zeros();
  const gradient = [0, 0, 0, 0, 0, 0];
  for (const { world, seen } of matches) {
    const expected = projected(world, view, lens) ?? seen;
    dependence(world, view, lens).forEach((row, axis) => {
      const error = (expected[axis] as number) - (seen[axis] as number);
      for (let i = 0; i < 6; i++) {
        const value = row[i] as number;
        gradient[i] = (gradient[i] as number) - value * error;
        const line = matrix[i] as number[];
        for (let j = 0; j < 6; j++) line[j] = (line[j] as number) + value * (row[j] as number);
      }
    });
  }
  return { matrix, gradient };
}

const zeros = (): number[][] => Array.from({ length: 6 }, () => [0, 0, 0, 0, 0, 0]);
