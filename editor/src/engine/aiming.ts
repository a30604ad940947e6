/**
 * What the cross in the middle of the view may mean: everything near the ray through it, the likeliest first. Unlike a
 * tap, it goes through what stands in front, and small things are found beside their edge, too.
 */

import { type Box3, Matrix4, type Mesh, type Object3D, type PerspectiveCamera, Ray, Vector3 } from "three";
import type { Thing } from "./thing";

/** Pixels around the cross within which something may be meant. */
export const CONE = 56;
/** At most so many are offered: more are not read. */
export const MOST_CANDIDATES = 8;
/** What a large picture and a great distance count, of what a cone's width beside the cross does. */
const LARGE = 0.5;
const FAR = 0.3;
/** m: how large those are that are drawn with all others of their kind. */
const SMALL = 0.015;
/** How often a place on the ray and one in a box are brought closer to each other. */
const TURNS = 8;

/** A part of a thing: a box in a frame of its own, or a ball. */
export type Target = { id: string } & ({ box: Box3; frame: Matrix4 } | { centre: Vector3; radius: number });

export interface Candidate {
  id: string;
  /** rad between the cross and its nearest place. */
  off: number;
  /** m from the eye. */
  distance: number;
  /** The lower, the likelier. */
  score: number;
}

/**
 * Give what lies within a cone around a ray from the eye, each thing once. `cone` is its half angle in rad. Near the
 * ray comes before beside it, small before large, near before far; `before` is who was best, who stays so in doubt.
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
    .slice(0, MOST_CANDIDATES);
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

/** The nearest places of ray and box, each sought from the other: both are convex, so that this comes to an end. */
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

/** The parts of all things that are shown, where they were drawn. */
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

/** The meshes of a thing; not those of what hangs on it. */
function meshesOf(root: Object3D, id: string, found: Mesh[] = []): Mesh[] {
  for (const child of root.children) {
    const owner = child.userData.item as string | undefined;
    if (!child.visible || (owner !== undefined && owner !== id)) continue;
    if (owner === id && (child as Mesh).isMesh) found.push(child as Mesh);
    meshesOf(child, id, found);
  }
  return found;
}

/** The ray through the middle of the view, and the half angle of the cone of so many pixels around it, rad. */
export function middle(camera: PerspectiveCamera, height: number, pixels = CONE): { ray: Ray; cone: number } {
  camera.updateMatrixWorld();
  const ray = new Ray(camera.getWorldPosition(new Vector3()), camera.getWorldDirection(new Vector3()));
  return { ray, cone: Math.atan((pixels * 2 * Math.tan((camera.fov * Math.PI) / 360)) / Math.max(1, height)) };
}
