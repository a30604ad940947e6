/** The pose of an object that a tool touches, computed as the server does (protocol, 7.3). Pure functions. */

import { t } from "@lingui/core/macro";
import type { ObjectModel, Orientation, Pivot } from "../protocol/types";

/** The tool points at the object: their z axes are opposite. */
export const FLIPPED: Orientation = { x: 1, y: 0, z: 0, w: 0 };

/** Return the distance of the object's centre behind the tool tip along the tool's z axis, m, or why it is unknown. */
export function pivotOffset(model: ObjectModel | undefined, pivot: Pivot): number | string {
  if (pivot === "middle") return 0;
  // For spheres the protocol uses half the radius.
  const height = model?.box?.size_z ?? model?.cylinder?.height ?? model?.sphere?.radius;
  if (height === undefined) return t`Only boxes, cylinders and spheres have a top and a bottom. Use the middle.`;
  return ((pivot === "top" ? -1 : 1) * height) / 2;
}
