/** Where an object is put that a tool touches, as the server does it (protocol, 7.3): pure. */

import { t } from "@lingui/core/macro";
import type { ObjectModel, Orientation, Pivot } from "../protocol/types";

/** The tool points at the object: their z axes are opposite. */
export const FLIPPED: Orientation = { x: 1, y: 0, z: 0, w: 0 };

/** By how much the centre of an object lies behind the tool's tip along the tool's z axis, m; else why nobody can say. */
export function pivotOffset(model: ObjectModel | undefined, pivot: Pivot): number | string {
  if (pivot === "middle") return 0;
  // Of a sphere the protocol takes half the radius.
  const height = model?.box?.size_z ?? model?.cylinder?.height ?? model?.sphere?.radius;
  if (height === undefined) return t`Only boxes, cylinders and spheres have a top and a bottom. Use the middle.`;
  return ((pivot === "top" ? -1 : 1) * height) / 2;
}
