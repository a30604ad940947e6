/** Conversion of poses between frames, in the types of the protocol. Pure functions. */

import type { Orientation, Pose, Position } from "../protocol/types";
import type { OpenDocument } from "../store/state";

export const ORIGIN: Pose = { position: { x: 0, y: 0, z: 0 }, orientation: { x: 0, y: 0, z: 0, w: 1 } };

/** Return the product of two quaternions: the rotation `b`, then `a`. */
export function times(a: Orientation, b: Orientation): Orientation {
  return {
    x: a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
    y: a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
    z: a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
    w: a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
  };
}

export function inverted({ x, y, z, w }: Orientation): Orientation {
  return { x: -x, y: -y, z: -z, w };
}

export function rotated(p: Position, by: Orientation): Position {
  const { x, y, z } = times(times(by, { ...p, w: 0 }), inverted(by));
  return { x, y, z };
}

export function plus(a: Position, b: Position): Position {
  return { x: a.x + b.x, y: a.y + b.y, z: a.z + b.z };
}

/** Return `pose`, given in `frame`, in the parent of `frame`. */
export function composed(frame: Pose, pose: Pose): Pose {
  return {
    position: plus(frame.position, rotated(pose.position, frame.orientation)),
    orientation: times(frame.orientation, pose.orientation),
  };
}

/** Return `pose` relative to `frame`, both in the same frame. */
export function relativeTo(frame: Pose, pose: Pose): Pose {
  const back = inverted(frame.orientation);
  const { x, y, z } = frame.position;
  return {
    position: rotated(plus(pose.position, { x: -x, y: -y, z: -z }), back),
    orientation: times(back, pose.orientation),
  };
}

/** Return the distance of two poses in the same frame, m and degrees. */
export function apart(a: Pose, b: Pose): { distance: number; degrees: number } {
  const { position: p, orientation: q } = relativeTo(a, b);
  return {
    distance: Math.hypot(p.x, p.y, p.z),
    degrees: (2 * Math.atan2(Math.hypot(q.x, q.y, q.z), Math.abs(q.w)) * 180) / Math.PI,
  };
}

/** Return the rotation by an angle, rad, about a unit axis. */
export function turn(axis: Position, angle: number): Orientation {
  const sine = Math.sin(angle / 2);
  return { x: axis.x * sine, y: axis.y * sine, z: axis.z * sine, w: Math.cos(angle / 2) };
}

/** Return the rotation of roll, pitch and yaw in degrees, the inverse of `rollPitchYaw`. */
export function fromRollPitchYaw([roll, pitch, yaw]: readonly [number, number, number]): Orientation {
  const RAD = Math.PI / 180;
  const x = turn({ x: 1, y: 0, z: 0 }, roll * RAD);
  const y = turn({ x: 0, y: 1, z: 0 }, pitch * RAD);
  const z = turn({ x: 0, y: 0, z: 1 }, yaw * RAD);
  return times(z, times(y, x));
}

/** Return the orientation closest to a given one whose z axis has a given direction. */
export function alongZ(direction: Position, from: Orientation = ORIGIN.orientation): Orientation {
  const z = rotated({ x: 0, y: 0, z: 1 }, from);
  const dot = z.x * direction.x + z.y * direction.y + z.z * direction.z;
  if (dot < -0.999_999) return times(turn(rotated({ x: 1, y: 0, z: 0 }, from), Math.PI), from);
  const q = {
    x: z.y * direction.z - z.z * direction.y,
    y: z.z * direction.x - z.x * direction.z,
    z: z.x * direction.y - z.y * direction.x,
    w: 1 + dot,
  };
  const length = Math.hypot(q.x, q.y, q.z, q.w);
  return times({ x: q.x / length, y: q.y / length, z: q.z / length, w: q.w / length }, from);
}

/** Return the pose of an object or a point in the world; the origin if it has none. */
export function worldOf(doc: OpenDocument, id: string | undefined): Pose {
  if (!id) return ORIGIN;
  const object = doc.objects[id];
  if (object) return object.pose ?? ORIGIN;
  const point = doc.points[id];
  if (point) return composed(worldOf(doc, point.parent), { position: point.position, orientation: ORIGIN.orientation });
  const orientation = doc.orientations[id];
  if (!orientation) return ORIGIN;
  return composed(worldOf(doc, orientation.pointId), {
    position: ORIGIN.position,
    orientation: orientation.orientation,
  });
}
