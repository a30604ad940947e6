/** Place the workplace by hand: movements of the workplace in the picture, and the views that result from them. */

import {
  add,
  apply,
  cross,
  type Mat3,
  multiply,
  type Point,
  rotation,
  scale,
  sub,
  transposed,
  unit,
  type Vec3,
} from "./geometry";
import { eyeOf, type Lens, type View } from "./pose";

/** A movement of the workplace: a turn about its z axis, rad, then a shift, m, in its frame before the movement. */
export interface Movement {
  angle: number;
  shift: Vec3;
}

/** Position of a camera and the point at which it looks. */
export interface Viewpoint {
  position: Vec3;
  target: Vec3;
}

/** The data stored by a device: the last view that was set by hand, and the correction of the view from markers. */
export interface Placement {
  sight?: Viewpoint;
  nudge?: Movement;
}

export type Direction = "left" | "right" | "away" | "closer" | "up" | "down" | "turnLeft" | "turnRight";

export const UNMOVED: Movement = { angle: 0, shift: [0, 0, 0] };
const UP: Vec3 = [0, 0, 1];
/** Farthest point of the floor that a drag moves, m. */
const FARTHEST = 20;

const about = (angle: number): Mat3 => rotation([0, 0, angle]);

/** Return the movement that applies `inner`, then `outer`. */
export function combined(outer: Movement, inner: Movement): Movement {
  return {
    angle: outer.angle + inner.angle,
    shift: add(apply(about(outer.angle), inner.shift), outer.shift),
  };
}

/** Return the view of the same camera after the workplace was moved. */
export function movedView({ turn, shift }: View, by: Movement): View {
  return { turn: multiply(turn, about(by.angle)), shift: add(apply(turn, by.shift), shift) };
}

/** Return where a movement moves a point. */
export const movedPoint = (point: Vec3, { angle, shift }: Movement): Vec3 => add(apply(about(angle), point), shift);

/** Return the turn about a vertical axis through a point. */
function turnAt(point: Vec3, angle: number): Movement {
  return { angle, shift: sub(point, apply(about(angle), point)) };
}

/** Return the view after the camera tilted upwards by an angle, rad. */
export function tilted({ turn, shift }: View, angle: number): View {
  const tilt = rotation([-angle, 0, 0]);
  return { turn: multiply(tilt, turn), shift: apply(tilt, shift) };
}

/** Return the point of the floor at a point of the picture; null at the horizon and above it. */
export function onFloor([x, y]: Point, view: View, lens: Lens): Vec3 | null {
  const eye = eyeOf(view);
  const ray = apply(transposed(view.turn), unit([(x - lens.cx) / lens.focal, (y - lens.cy) / lens.focal, 1]));
  const distance = -eye[2] / ray[2];
  return distance > 0 && distance < FARTHEST ? add(eye, scale(ray, distance)) : null;
}

/**
 * Return the movement for a drag in the picture; null if the fingers leave the floor. With one finger, the workplace
 * moves over the floor. With two, it also turns with them, and is closer if they are spread.
 */
export function dragged(from: readonly Point[], to: readonly Point[], view: View, lens: Lens): Movement | null {
  const [before, after] = [onFloor(middle(from), view, lens), onFloor(middle(to), view, lens)];
  if (!before || !after) return null;
  const slide: Movement = { angle: 0, shift: sub(after, before) };
  const [a, b] = [span(from), span(to)];
  if (a.length < 1 || b.length < 1) return slide;
  // The y axis of the picture points down, so a turn to the right in the picture is one to the left seen from above.
  const turn = turnAt(before, Math.atan2(Math.sin(a.angle - b.angle), Math.cos(a.angle - b.angle)));
  const approach: Movement = { angle: 0, shift: scale(sub(eyeOf(view), before), 1 - a.length / b.length) };
  return combined(slide, combined(approach, turn));
}

const middle = (points: readonly Point[]): Point => [
  points.reduce((sum, [x]) => sum + x, 0) / points.length,
  points.reduce((sum, [, y]) => sum + y, 0) / points.length,
];

function span([a, b]: readonly Point[]): { length: number; angle: number } {
  if (!a || !b) return { length: 0, angle: 0 };
  return { length: Math.hypot(b[0] - a[0], b[1] - a[1]), angle: Math.atan2(b[1] - a[1], b[0] - a[0]) };
}

/** Return the movement by a distance, m, or an angle, rad, in a direction as seen from the camera. */
export function stepTowards(direction: Direction, size: { distance: number; angle: number }, view: View): Movement {
  const right = unit([view.turn[0][0], view.turn[0][1], 0]);
  const away = cross(UP, right);
  const shift = (along: Vec3, sign: number): Movement => ({ angle: 0, shift: scale(along, sign * size.distance) });
  switch (direction) {
    case "right":
      return shift(right, 1);
    case "left":
      return shift(right, -1);
    case "away":
      return shift(away, 1);
    case "closer":
      return shift(away, -1);
    case "up":
      return shift(UP, 1);
    case "down":
      return shift(UP, -1);
    default:
      return turnAt(ahead(view), direction === "turnLeft" ? size.angle : -size.angle);
  }
}

/** Return the point of the floor in the middle of the picture, or a point 1 m ahead of the camera. */
function ahead(view: View): Vec3 {
  return onFloor([0, 0], view, { focal: 1, cx: 0, cy: 0 }) ?? viewpointOf(view).target;
}

export function viewpointOf(view: View): Viewpoint {
  const position = eyeOf(view);
  return { position, target: add(position, view.turn[2]) };
}

/**
 * Return the view with which placing starts.
 *
 * @param orientation orientation of the camera by the motion sensor; with it, the vertical of the workplace is that of
 *     the sensor, and the camera has the same target at the same distance.
 */
export function viewFrom({ position, target }: Viewpoint, orientation: Mat3 | null): View {
  const sight = sub(target, position);
  const forward = unit(sight);
  const right = unit(cross(forward, UP));
  if (!orientation) {
    const turn: Mat3 = [right, cross(forward, right), forward];
    return { turn, shift: scale(apply(turn, position), -1) };
  }
  const heading = Math.atan2(orientation[1][0], orientation[0][0]) - Math.atan2(right[1], right[0]);
  const turn = multiply(transposed(orientation), about(heading));
  const eye = sub(target, scale(turn[2], Math.hypot(...sight)));
  return { turn, shift: scale(apply(turn, eye), -1) };
}
