/**
 * Candidates at the crosshair in the middle of the view: everything near the ray through it, most likely first. Unlike
 * a tap, it also finds hidden items and small items next to it.
 */

import { type Box3, Matrix4, type PerspectiveCamera, Ray, Vector3 } from "three";
import { meshesOf, type Thing } from "./thing";

/** Radius of the search around the crosshair, pixels. */
export const CONE = 56;
/** Largest number of candidates. */
const MAX_CANDIDATES = 8;
/** Weights of size and distance relative to the distance from the crosshair. */
const LARGE = 0.5;
const FAR = 0.3;
/** Assumed size of items that are drawn as instances, m. */
const SMALL = 0.015;
/** Iterations of the search for the closest points of a ray and a box. */
const TURNS = 8;

/** A part of an item: a box in its own frame, or a sphere. */
export type Target = { id: string } & ({ box: Box3; frame: Matrix4 } | { centre: Vector3; radius: number });

interface Candidate {
  id: string;
  /** Angle between the crosshair and its closest point, rad. */
  off: number;
  /** Distance from the camera, m. */
  distance: number;
  /** Lower is more likely. */
  score: number;
}

/**
 * Return the items within a cone around a ray from the camera, each once. `cone` is its half angle, rad. Items near the
 * ray come first, small before large, near before far; `before` is the previous best one, which wins ties.
 */
export function aimed(targets: Iterable<Target>, ray: Ray, cone: number, before = ""): Candidate[] {
  const found = new Map<string, { off: number; distance: number; size: number }>();
  for (const target of targets) {
    const part = "box" in target ? ofBox(target, ray) : ofBall(target, ray);
    if (!part || part.off > cone) continue;
    const known = found.get(target.id);
    if (!known) found.set(target.id, part);
    else {
      known.size = Math.max(known.size, part.size);
      if (part.off < known.off) Object.assign(known, { off: part.off, distance: part.distance });
    }
  }
  const nearest = Math.min(...[...found.values()].map((each) => each.distance));
  return [...found]
    .map(([id, { off, distance, size }]) => ({
      id,
      off,
      distance,
      score:
        off / cone +
        LARGE * Math.min(1, size / (2 * cone)) +
        FAR * (1 - nearest / distance) -
        (id === before ? 0.05 : 0),
    }))
    .sort((a, b) => a.score - b.score || a.distance - b.distance)
    .slice(0, MAX_CANDIDATES);
}

const inverse = new Matrix4();
const local = new Ray();
const onRay = new Vector3();
const inBox = new Vector3();
const corner = new Vector3();

function ofBall({ centre, radius }: { centre: Vector3; radius: number }, ray: Ray) {
  const to = inBox.subVectors(centre, ray.origin);
  const distance = Math.max(to.length(), 1e-6);
  const size = Math.asin(Math.min(1, radius / distance));
  const off = Math.max(0, to.angleTo(ray.direction) - size);
  return { off, distance, size };
}

/** Closest points of ray and box by alternating projection, which converges since both are convex. */
function ofBox({ box, frame }: { box: Box3; frame: Matrix4 }, ray: Ray) {
  local.copy(ray).applyMatrix4(inverse.copy(frame).invert());
  local.direction.normalize();
  const hit = local.intersectBox(box, inBox);
  if (!hit) {
    box.getCenter(inBox);
    for (let turn = 0; turn < TURNS; turn++) {
      local.closestPointToPoint(inBox, onRay);
      box.clampPoint(onRay, inBox);
    }
  }
  const size = 0.5 * box.min.distanceTo(box.max) * frame.getMaxScaleOnAxis();
  corner.copy(inBox).applyMatrix4(frame).sub(ray.origin);
  const distance = Math.max(corner.length(), 1e-6);
  return { off: hit ? 0 : corner.angleTo(ray.direction), distance, size: Math.atan(size / distance) };
}

/** Return the parts of all visible items, as drawn in the last frame. */
export function* targetsOf(things: Iterable<Thing>): Generator<Target> {
  for (const thing of things) {
    const { id, faint, kind } = thing.item;
    if (faint >= 1) continue;
    const meshes = kind === "object" || kind === "robot" ? meshesOf(thing.root, id) : [];
    for (const mesh of meshes) {
      if (!mesh.geometry.boundingBox) mesh.geometry.computeBoundingBox();
      if (mesh.geometry.boundingBox) yield { id, box: mesh.geometry.boundingBox, frame: mesh.matrixWorld };
    }
    if (meshes.length === 0) yield { id, centre: thing.anchor(new Vector3()), radius: SMALL };
  }
}

/** Return the ray through the middle of the view, and the half angle of a cone with a radius in pixels, rad. */
export function middle(camera: PerspectiveCamera, height: number, pixels = CONE): { ray: Ray; cone: number } {
  camera.updateMatrixWorld();
  const ray = new Ray(camera.getWorldPosition(new Vector3()), camera.getWorldDirection(new Vector3()));
  return { ray, cone: Math.atan((pixels * 2 * Math.tan((camera.fov * Math.PI) / 360)) / Math.max(1, height)) };
}
