/** The point in the middle of the view, at the crosshair. */

import type { Orientation, Position } from "../protocol/types";
import { theEngine } from "../session/engine";
import { DOWN } from "./startingValues";

/** Return the point at the crosshair and the orientation of a tool facing that surface; null if there is none. */
export function aimedPlace(): { position: Position; orientation: Orientation } | null {
  const engine = theEngine();
  const view = document.querySelector(".view")?.getBoundingClientRect();
  if (!engine || !view || view.width < 2) return null;
  const [x, y] = [view.width / 2, view.height / 2];
  const hit = engine.pick(x, y, 0).find((each) => each.normal !== null);
  const point = hit?.point ?? engine.floor(x, y);
  if (!point) return null;
  const position = { x: point.x, y: point.y, z: point.z };
  return { position, orientation: hit?.normal ? against(hit.normal) : DOWN };
}

/** Return the rotation that turns z against a normal: a tool facing the surface. */
export function against({ x, y, z }: Position): Orientation {
  // Halfway from +z to -normal; a tool facing straight up is turned about x.
  if (z > 0.9999) return DOWN;
  const w = 1 - z;
  const length = Math.hypot(y, x, w);
  return { x: y / length, y: -x / length, z: 0, w: w / length };
}
