/** Items under the pointer: all candidates, best first. */

import { type Camera, type Intersection, type Object3D, Raycaster, Vector2, type Vector3 } from "three";

export interface Hit {
  id: string;
  /** Point in the world. */
  point: Vector3;
  /** Outward normal of the surface in the world, if there is one. */
  normal: Vector3 | null;
  /** Distance from the camera, m. */
  distance: number;
}

/** Directions of additional rays around the pointer, since fingers are wide and points small. */
const AROUND: [number, number][] = [0, 1, 2, 3, 4, 5, 6, 7].map((n) => [
  Math.cos((n * Math.PI) / 4),
  Math.sin((n * Math.PI) / 4),
]);

const caster = new Raycaster();
caster.params.Line.threshold = 0.002; // Tolerance for lines, m; the default of three.js is 1 m
caster.layers.enable(1); // connections, which are drawn together
const place = new Vector2();

export interface Size {
  width: number;
  height: number;
}

/**
 * Return the items at a position in the view, pixels from the upper left corner. Direct hits come first, near before
 * far; then items within `slack` pixels. `small` returns whether an id is hard to hit: such items precede large ones
 * close to them.
 */
export function pick(
  x: number,
  y: number,
  size: Size,
  camera: Camera,
  roots: Object3D[],
  slack: number,
  small: (id: string) => boolean,
): Hit[] {
  const found = new Map<string, Hit & { score: number }>();
  const cast = (dx: number, dy: number, penalty: number, onlySmall: boolean) => {
    place.set(((x + dx) / size.width) * 2 - 1, 1 - ((y + dy) / size.height) * 2);
    caster.setFromCamera(place, camera);
    for (const each of caster.intersectObjects(roots, true)) {
      const id = idOf(each);
      if (id === undefined || (onlySmall && !small(id))) continue;
      const score = each.distance * (small(id) ? 0.85 : 1) * (1 + penalty);
      const known = found.get(id);
      if (known && known.score <= score) continue;
      // Points, pucks and arrows are drawn as instances: they mark places and have no surface to place anything on.
      const face = each.instanceId === undefined ? each.face : null;
      const normal = face ? face.normal.clone().transformDirection(each.object.matrixWorld) : null;
      found.set(id, { id, point: each.point.clone(), normal, distance: each.distance, score });
    }
  };
  cast(0, 0, 0, false);
  if (slack > 0) for (const [dx, dy] of AROUND) cast(dx * slack, dy * slack, 0.03, true);
  return [...found.values()].sort((a, b) => a.score - b.score).map(({ score: _, ...hit }) => hit);
}

function idOf(hit: Intersection): string | undefined {
  const batch = hit.object.userData.batch as ((index: number) => string | undefined) | undefined;
  if (batch) return hit.instanceId === undefined ? undefined : batch(hit.instanceId);
  for (let each: Object3D | null = hit.object; each; each = each.parent) {
    if (!each.visible) return undefined;
    const id = each.userData.item as string | undefined;
    if (id !== undefined) return id;
  }
  return undefined;
}

/** Return where the ray meets the floor, or the level z, within `far`, m. */
export function onFloor(x: number, y: number, size: Size, camera: Camera, far = 20, level = 0): Vector3 | null {
  place.set((x / size.width) * 2 - 1, 1 - (y / size.height) * 2);
  caster.setFromCamera(place, camera);
  const { origin, direction } = caster.ray;
  if (direction.z >= -1e-6) return null;
  const distance = (level - origin.z) / direction.z;
  return distance > 0 && distance < far ? origin.clone().addScaledVector(direction, distance) : null;
}
