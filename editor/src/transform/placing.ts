/** Poses after a drag, a step or a typed number. Pure functions; poses are in the world unless stated otherwise. */

import type { Orientation, Pose, Position } from "../protocol/types";
import { composed, inverted, ORIGIN, plus, relativeTo, rotated, times, turn } from "../viewmodel/frames";
import { rollPitchYaw } from "../viewmodel/rotations";

export type Axis = "x" | "y" | "z";
export const AXES: readonly Axis[] = ["x", "y", "z"];
/** Frames of the axes. `own`: of the item; `view`: right, up, and towards the camera. */
export type FrameName = "world" | "parent" | "robot" | "own" | "view";

export const unit = (axis: Axis): Position => ({
  x: axis === "x" ? 1 : 0,
  y: axis === "y" ? 1 : 0,
  z: axis === "z" ? 1 : 0,
});
const scaled = ({ x, y, z }: Position, by: number): Position => ({ x: x * by, y: y * by, z: z * by });
export const minus = (a: Position, b: Position): Position => plus(a, scaled(b, -1));
export const dot = (a: Position, b: Position): number => a.x * b.x + a.y * b.y + a.z * b.z;

/** Move along an axis of a frame, m. */
export function moved(pose: Pose, frame: Pose, axis: Axis, by: number): Pose {
  return { ...pose, position: plus(pose.position, scaled(rotated(unit(axis), frame.orientation), by)) };
}

/** Turn about an axis of a frame around the item's origin, rad. */
export function turned(pose: Pose, frame: Pose, axis: Axis, by: number): Pose {
  return { ...pose, orientation: normal(times(turn(rotated(unit(axis), frame.orientation), by), pose.orientation)) };
}

export function turnedAbout(pose: Pose, axis: Position, by: number): Pose {
  return { ...pose, orientation: normal(times(turn(axis, by), pose.orientation)) };
}

/**
 * Return the pose of an item that a camera carries from one pose to another: it keeps its place in the picture, or, if
 * it turns, its orientation there. Positions are rounded to 0.1 mm.
 */
export function carried(start: Pose, from: Pose, to: Pose, turns: boolean): Pose {
  const { position, orientation } = composed(to, relativeTo(from, start));
  if (turns) return { ...start, orientation: normal(orientation) };
  const { x, y, z } = position;
  return { ...start, position: { x: rounded(x, 1e-4), y: rounded(y, 1e-4), z: rounded(z, 1e-4) } };
}

/** Set one coordinate in a frame. */
export function placedAt(pose: Pose, frame: Pose, axis: Axis, value: number): Pose {
  const seen = relativeTo(frame, pose);
  return composed(frame, { ...seen, position: { ...seen.position, [axis]: value } });
}

/** Set roll, pitch or yaw in a frame, rad; the other two stay. */
export function turnedTo(pose: Pose, frame: Pose, axis: Axis, value: number): Pose {
  const seen = relativeTo(frame, pose);
  const [roll, pitch, yaw] = angles(seen.orientation);
  const wanted = { x: roll, y: pitch, z: yaw, [axis]: value };
  return composed(frame, { ...seen, orientation: fromAngles(wanted) });
}

/** Return roll, pitch and yaw, rad. */
export function angles(orientation: Orientation): [number, number, number] {
  return rollPitchYaw(orientation).map((each) => (each * Math.PI) / 180) as [number, number, number];
}

export function fromAngles({ x, y, z }: Position): Orientation {
  return times(turn(unit("z"), z), times(turn(unit("y"), y), turn(unit("x"), x)));
}

/** Return the nearest multiple of a step; the value itself without a step. */
export function rounded(value: number, step: number): number {
  return step > 0 ? Math.round(value / step) * step : value;
}

/** Return the nearest point of a frame's grid along the named axes; the other coordinates stay. */
export function onGrid(position: Position, frame: Pose, step: number, along: readonly Axis[] = AXES): Position {
  const seen = relativeTo(frame, { position, orientation: ORIGIN.orientation }).position;
  const next = { ...seen };
  for (const axis of along) next[axis] = rounded(seen[axis], step);
  return composed(frame, { position: next, orientation: ORIGIN.orientation }).position;
}

/** Return the nearest of the 24 rotations that align the axes with those of a frame. */
export function squared(orientation: Orientation, frame: Orientation): Orientation {
  const seen = times(inverted(frame), orientation);
  let best: Orientation = ORIGIN.orientation;
  let most = -1;
  for (const each of UPRIGHT) {
    const likeness = Math.abs(seen.x * each.x + seen.y * each.y + seen.z * each.z + seen.w * each.w);
    if (likeness > most + 1e-9) [best, most] = [each, likeness];
  }
  return normal(times(frame, best));
}

/** All rotations by multiples of 90°. */
const UPRIGHT: readonly Orientation[] = (() => {
  const quarter = (axis: Axis, n: number) => turn(unit(axis), (n * Math.PI) / 2);
  const faces = [quarter("x", 0), quarter("x", 1), quarter("x", 2), quarter("x", 3), quarter("y", 1), quarter("y", 3)];
  return faces.flatMap((face) => [0, 1, 2, 3].map((n) => times(face, quarter("z", n))));
})();

export function normal({ x, y, z, w }: Orientation): Orientation {
  const length = Math.hypot(x, y, z, w) || 1;
  return { x: x / length, y: y / length, z: z / length, w: w / length };
}

export function same(a: Pose, b: Pose): boolean {
  const p = minus(a.position, b.position);
  const o = a.orientation;
  const q = b.orientation;
  return Math.hypot(p.x, p.y, p.z) < 1e-7 && 1 - Math.abs(o.x * q.x + o.y * q.y + o.z * q.z + o.w * q.w) < 1e-13;
}

/**
 * Read a copied pose: three numbers are a position, four a quaternion (x, y, z, w), seven both, six a position with
 * roll, pitch and yaw in °; lengths in m. Missing parts are taken from `now`. Return null if it is not a pose.
 */
export function poseFrom(text: string, now: Pose): Pose | null {
  const numbers = text.match(/-?\d*\.?\d+(?:e[+-]?\d+)?/gi)?.map(Number) ?? [];
  const p = (at: number): Position => ({ x: numbers[at] ?? 0, y: numbers[at + 1] ?? 0, z: numbers[at + 2] ?? 0 });
  const q = (at: number): Orientation | null => {
    const read = { ...p(at), w: numbers[at + 3] ?? 0 };
    const length = Math.hypot(read.x, read.y, read.z, read.w);
    return Math.abs(length - 1) < 0.02 ? normal(read) : null;
  };
  if (numbers.length === 3) return { ...now, position: p(0) };
  if (numbers.length === 6) return { position: p(0), orientation: fromAngles(scaled(p(3), Math.PI / 180)) };
  const orientation = numbers.length === 4 ? q(0) : numbers.length === 7 ? q(3) : null;
  if (!orientation) return null;
  return { position: numbers.length === 7 ? p(0) : now.position, orientation };
}

/** Return a pose as text: position in m and quaternion. */
export function poseText({ position: p, orientation: o }: Pose): string {
  return [p.x, p.y, p.z, o.x, o.y, o.z, o.w].map((each) => Number(each.toFixed(6))).join(", ");
}

/** Return a point at a distance along a direction. */
export function plusOf(from: Position, direction: Position, by: number): Position {
  return { x: from.x + direction.x * by, y: from.y + direction.y * by, z: from.z + direction.z * by };
}
