/** The pose of the camera at which the relevant items fill the free part of the view. Pure functions. */

import { type Box3, Vector3 } from "three";

/** A view: its size, the margins covered by controls, pixels, and the vertical opening angle, degrees. */
export interface FramedView {
  width: number;
  height: number;
  fov: number;
  margins: { left: number; right: number; top: number; bottom: number };
}

export interface Placed {
  position: Vector3;
  /** Point on the axis of the camera at the depth of the middle. */
  target: Vector3;
}

/** Smallest distance of the camera from the nearest point, m. */
const CLOSEST = 0.3;
const UP = new Vector3(0, 0, 1);
/** Directions of the first view, degrees from the x axis and above the floor, each with its preference. */
const AZIMUTHS = [
  [-50, 1],
  [-35, 0.98],
  [-65, 0.98],
  [-20, 0.93],
  [-80, 0.93],
] as const;
const ELEVATIONS = [
  [30, 1],
  [40, 0.93],
  [50, 0.85],
] as const;

/** Controls at the edges of a view, pixels. */
export function marginsOf(width: number, height: number): FramedView["margins"] {
  const side = Math.min(28, width * 0.05);
  return { left: side, right: side, top: Math.min(72, height * 0.16), bottom: Math.min(24, height * 0.05) };
}

/**
 * Return the place of the camera from which the points just fill the free part of the view. `back` points from the
 * points to the camera. Each side of the view is a plane through the camera, so the place follows from the outermost
 * points without iteration.
 */
export function fitted(points: readonly Vector3[], back: Vector3, opening: FramedView): Placed {
  const z = back.clone().normalize();
  const x = new Vector3().crossVectors(UP, z);
  if (x.lengthSq() < 1e-9) x.set(1, 0, 0);
  x.normalize();
  const y = new Vector3().crossVectors(z, x);
  const { width, height, margins } = opening;
  const half = Math.tan((opening.fov * Math.PI) / 360);
  const perPixel = (2 * half) / height;
  const slopes = {
    right: (width / 2 - margins.right) * perPixel,
    left: (width / 2 - margins.left) * perPixel,
    top: (height / 2 - margins.top) * perPixel,
    bottom: (height / 2 - margins.bottom) * perPixel,
  };
  const outer = { right: -Infinity, left: Infinity, top: -Infinity, bottom: Infinity, near: -Infinity, far: Infinity };
  for (const point of points) {
    const [px, py, pz] = [point.dot(x), point.dot(y), point.dot(z)];
    outer.right = Math.max(outer.right, px + slopes.right * pz);
    outer.left = Math.min(outer.left, px - slopes.left * pz);
    outer.top = Math.max(outer.top, py + slopes.top * pz);
    outer.bottom = Math.min(outer.bottom, py - slopes.bottom * pz);
    outer.near = Math.max(outer.near, pz);
    outer.far = Math.min(outer.far, pz);
  }
  const depth = Math.max(
    (outer.right - outer.left) / (slopes.right + slopes.left),
    (outer.top - outer.bottom) / (slopes.top + slopes.bottom),
    outer.near + CLOSEST,
  );
  const across = (outer.right - slopes.right * depth + outer.left + slopes.left * depth) / 2;
  const upwards = (outer.top - slopes.top * depth + outer.bottom + slopes.bottom * depth) / 2;
  const at = (away: number) =>
    new Vector3().addScaledVector(x, across).addScaledVector(y, upwards).addScaledVector(z, away);
  return { position: at(depth), target: at((outer.near + outer.far) / 2) };
}

/** Return the part of the free view inside the rectangle around the points, 0 to 1. */
export function filled(points: readonly Vector3[], { position, target }: Placed, opening: FramedView): number {
  const z = new Vector3().subVectors(position, target).normalize();
  const x = new Vector3().crossVectors(UP, z).normalize();
  const y = new Vector3().crossVectors(z, x);
  const { width, height, margins } = opening;
  const pixels = height / (2 * Math.tan((opening.fov * Math.PI) / 360));
  const box = { left: Infinity, right: -Infinity, bottom: Infinity, top: -Infinity };
  for (const point of points) {
    const to = point.clone().sub(position);
    const scale = pixels / -to.dot(z);
    box.left = Math.min(box.left, to.dot(x) * scale);
    box.right = Math.max(box.right, to.dot(x) * scale);
    box.bottom = Math.min(box.bottom, to.dot(y) * scale);
    box.top = Math.max(box.top, to.dot(y) * scale);
  }
  const free = (width - margins.left - margins.right) * (height - margins.top - margins.bottom);
  return ((box.right - box.left) * (box.top - box.bottom)) / free;
}

/** Return the direction in front of the workplace from which the points fill the view best. */
export function bestDirection(points: readonly Vector3[], opening: FramedView): Vector3 {
  let best = new Vector3();
  let most = 0;
  for (const [elevation, one] of ELEVATIONS)
    for (const [azimuth, other] of AZIMUTHS) {
      const [a, e] = [(azimuth * Math.PI) / 180, (elevation * Math.PI) / 180];
      const back = new Vector3(Math.cos(a) * Math.cos(e), Math.sin(a) * Math.cos(e), Math.sin(e));
      const part = filled(points, fitted(points, back, opening), opening) * one * other;
      if (part <= most) continue;
      most = part;
      best = back;
    }
  return best;
}

/**
 * Return the corners of the boxes that matter. A flat box below most others, such as a table top or a floor, is left
 * out, because it would make everything on it small.
 */
export function corners(boxes: readonly Box3[]): Vector3[] {
  const all = boxes.filter((box) => !box.isEmpty());
  const some = all.filter((box) => !isGround(box, all));
  return (some.length > 0 ? some : all).flatMap(({ min, max }) =>
    [min.x, max.x].flatMap((x) => [min.y, max.y].flatMap((y) => [min.z, max.z].map((z) => new Vector3(x, y, z)))),
  );
}

function isGround(box: Box3, all: readonly Box3[]): boolean {
  const size = box.getSize(new Vector3());
  if (size.z > 0.1 * Math.min(size.x, size.y)) return false;
  const middle = new Vector3();
  const above = all.filter((other) => {
    other.getCenter(middle);
    const { min, max } = box;
    return (
      other !== box && middle.z >= min.z && middle.x > min.x && middle.x < max.x && middle.y > min.y && middle.y < max.y
    );
  });
  return above.length > 0 && above.length >= (all.length - 1) / 2;
}
