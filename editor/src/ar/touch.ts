/** Registration by three points of the workplace that the user touches with a controller or a finger. */

import { Matrix4 } from "three";
import {
  apply,
  cross,
  dot,
  type Mat3,
  mean,
  multiply,
  norm,
  rotation,
  sub,
  transposed,
  unit,
  type Vec3,
} from "./geometry";
import type { Places } from "./pose";
import { ASIDE, FAIR, GOOD, type Grade } from "./registration";

/** A point whose position in the workplace is known. `corner` counts clockwise from the upper left one, from 0. */
export interface KnownPoint {
  marker: number;
  corner: number;
  at: Vec3;
}

/** A fit, or the reason why there is none: the points are on a line, or those at `points` contradict the others. */
export type TouchFit =
  | { workplace: Matrix4; error: number; grade: Grade }
  | { problem: "line" | "contradicting"; points: number[] };

/** Standard deviation of a touched point, m: the tip of a controller is a few millimetres off. */
const TOUCH = 0.004;
/** Smallest height of the triangle, m. */
const LOWEST = 0.05;
/** Largest error of a side of the triangle, m, and largest tilt of the workplace, rad. */
const SIDE = 0.02;
const TILT = 0.14;

/** Return the three corners of markers that span the largest triangle; none with less than one marker. */
export function knownPoints(places: Places): KnownPoint[] {
  const all = [...places].flatMap(([marker, { corners }]) =>
    corners.map((at, corner): KnownPoint => ({ marker, corner, at })),
  );
  let best: KnownPoint[] = [];
  let largest = 0;
  for (const [i, a] of all.entries()) {
    for (const [j, b] of all.entries()) {
      for (const c of j > i ? all.slice(j + 1) : []) {
        const height = heightOf([a.at, b.at, c.at]);
        if (height > largest) [best, largest] = [[a, b, c], height];
      }
    }
  }
  return best;
}

/** Return the pose of the workplace in the frame of WebXR (y up) in which the points were touched. */
export function fitTouched(known: readonly Vec3[], touched: readonly Vec3[]): TouchFit {
  if (heightOf(known) < LOWEST || heightOf(touched) < LOWEST) return { problem: "line", points: [0, 1, 2] };
  const wrong = misplaced(known, touched);
  if (wrong.length > 0) return { problem: "contradicting", points: wrong };
  const turn = turnBetween(known, touched);
  // Touched in another order, the triangle can fit upside down. The second row is the vertical of WebXR.
  if (turn[1][2] < Math.cos(TILT)) return { problem: "contradicting", points: [0, 1, 2] };
  const [x, y, z] = sub(mean(touched), apply(turn, mean(known)));
  const workplace = new Matrix4().set(...turn[0], x, ...turn[1], y, ...turn[2], z, 0, 0, 0, 1);
  const error = errorOf(known, touched, turn);
  return { workplace, error, grade: error > FAIR ? "rough" : error > GOOD ? "fair" : "good" };
}

/** Return the points that make sides of the triangle too long or too short. */
function misplaced(known: readonly Vec3[], touched: readonly Vec3[]): number[] {
  // Side n is opposite to point n.
  const off = [0, 1, 2].map((n) => Math.abs(sideOf(known, n) - sideOf(touched, n)));
  if (Math.max(...off) <= SIDE) return [];
  const fits = off.map((each) => each <= SIDE);
  const only = fits.indexOf(true);
  // If one side fits, the point opposite to it is wrong; if two fit, one of the ends of the third is.
  if (fits.filter(Boolean).length === 1) return [only];
  return fits.some(Boolean) ? [0, 1, 2].filter((n) => fits[n]) : [0, 1, 2];
}

const point = (points: readonly Vec3[], n: number) => points[n % 3] as Vec3;
const sideOf = (points: readonly Vec3[], n: number) => norm(sub(point(points, n + 1), point(points, n + 2)));

/** Return the smallest height of a triangle, m. */
function heightOf(points: readonly Vec3[]): number {
  const double = norm(cross(sub(point(points, 1), point(points, 0)), sub(point(points, 2), point(points, 0))));
  return double / Math.max(1e-9, sideOf(points, 0), sideOf(points, 1), sideOf(points, 2));
}

/** Return the axes of a triangle as rows: towards its first point, across in its plane, and its normal. */
function axesOf(points: readonly Vec3[]): Mat3 {
  const out = unit(cross(sub(point(points, 1), point(points, 0)), sub(point(points, 2), point(points, 0))));
  const first = unit(sub(point(points, 0), mean(points)));
  return [first, cross(out, first), out];
}

/** Return the rotation with the least squares: the planes coincide, and the turn in the plane is a mean. */
function turnBetween(from: readonly Vec3[], to: readonly Vec3[]): Mat3 {
  const [axes, goal] = [axesOf(from), axesOf(to)];
  const inPlane = (points: readonly Vec3[], frame: Mat3) => points.map((each) => apply(frame, sub(each, mean(points))));
  const seen = inPlane(to, goal);
  let [along, across] = [0, 0];
  inPlane(from, axes).forEach((each, n) => {
    const other = seen[n] as Vec3;
    along += dot(each, other);
    across += cross(each, other)[2];
  });
  return multiply(transposed(goal), multiply(rotation([0, 0, Math.atan2(across, along)]), axes));
}

/**
 * Return the standard deviation 0.5 m from the points, m, in the worst direction. It grows with the distance, since
 * touched points that are close to each other give the directions less exactly.
 */
function errorOf(known: readonly Vec3[], touched: readonly Vec3[], turn: Mat3): number {
  const [from, to] = [mean(known), mean(touched)];
  let squares = 0;
  known.forEach((each, n) => {
    squares += norm(sub(apply(turn, sub(each, from)), sub(point(touched, n), to))) ** 2;
  });
  // Nine coordinates, of which the fit leaves three free.
  const deviation = Math.max(TOUCH, Math.sqrt(squares / 3));
  // The axis in the plane about which the points turn most easily.
  const flat = known.map((each) => apply(axesOf(known), sub(each, from)));
  const sum = (of: (at: Vec3) => number) => flat.reduce((total, each) => total + of(each), 0);
  const [xx, yy, xy] = [sum(([x]) => x * x), sum(([, y]) => y * y), sum(([x, y]) => x * y)];
  const least = (xx + yy) / 2 - Math.hypot((xx - yy) / 2, xy);
  return deviation * Math.sqrt(1 / 3 + ASIDE ** 2 / least);
}
