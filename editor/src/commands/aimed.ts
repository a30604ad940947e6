/** The place in the middle of the view, where the cross is. */

import type { Orientation, Position } from "../protocol/types";
import { theEngine } from "../session/engine";
import { DOWN } from "./program";

/** Give where the cross points, and how a tool would stand on that surface; null when it points at nothing. */
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

/** The rotation that turns z against a normal: a tool that stands on the surface. */
export function against({ x, y, z }: Position): Orientation {
  // Half way from +z to -normal; straight up is turned about x.
  if (z > 0.9999) return DOWN;
  const w = 1 - z;
  const length = Math.hypot(y, x, w);
  return { x: y / length, y: -x / length, z: 0, w: w / length };
}
