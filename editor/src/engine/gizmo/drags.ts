/** Convert pointer movements to distances along an axis, in a plane, or to angles about an axis. Pure geometry. */

import { type Ray, Vector3 } from "three";

/** Smallest angle between a ray and a plane or axis; below it a pixel would mean metres. */
const FLAT = 0.03;

/** Return the point of an axis closest to the ray, m from the origin; null if they are parallel. */
export function alongAxis(ray: Ray, origin: Vector3, axis: Vector3): number | null {
  const between = new Vector3().subVectors(origin, ray.origin);
  const cosine = axis.dot(ray.direction);
  const apart = 1 - cosine * cosine;
  if (apart < FLAT * FLAT) return null;
  return (cosine * ray.direction.dot(between) - axis.dot(between)) / apart;
}

/** Return the point where the ray meets a plane in front of it. */
export function onPlane(ray: Ray, origin: Vector3, normal: Vector3): Vector3 | null {
  const slope = normal.dot(ray.direction);
  if (Math.abs(slope) < FLAT) return null;
  const distance = new Vector3().subVectors(origin, ray.origin).dot(normal) / slope;
  return distance > 0 ? ray.origin.clone().addScaledVector(ray.direction, distance) : null;
}

/** Return the angle from one direction to another about an axis, rad; they need not be perpendicular to it. */
export function angleBetween(from: Vector3, to: Vector3, axis: Vector3): number {
  const a = from.clone().projectOnPlane(axis);
  const b = to.clone().projectOnPlane(axis);
  return Math.atan2(axis.dot(a.clone().cross(b)), a.dot(b));
}

/** Return the equivalent angle that is closest to the last one, so that turns can exceed 180°. */
export function unwound(angle: number, last: number): number {
  return angle + Math.round((last - angle) / (2 * Math.PI)) * 2 * Math.PI;
}

/** Return the distance of a point from a line segment, px. */
export function toSegment(x: number, y: number, a: { x: number; y: number }, b: { x: number; y: number }): number {
  const dx = b.x - a.x;
  const dy = b.y - a.y;
  const length = dx * dx + dy * dy;
  const part = length ? Math.min(1, Math.max(0, ((x - a.x) * dx + (y - a.y) * dy) / length)) : 0;
  return Math.hypot(x - a.x - part * dx, y - a.y - part * dy);
}
