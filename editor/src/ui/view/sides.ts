/** Faces of the view cube: name, normal, and directions of the text and its upper edge. */

import type { MessageDescriptor } from "@lingui/core";
import { msg } from "@lingui/core/macro";
import type { ViewName } from "../../engine/camera";

export type Direction = [number, number, number];

export const SIDES: [Exclude<ViewName, "home">, MessageDescriptor, Direction, Direction, Direction][] = [
  ["top", msg`Top`, [0, 0, 1], [1, 0, 0], [0, 1, 0]],
  ["front", msg`Front`, [0, -1, 0], [1, 0, 0], [0, 0, 1]],
  ["back", msg`Back`, [0, 1, 0], [-1, 0, 0], [0, 0, 1]],
  ["side", msg`Right`, [1, 0, 0], [0, 1, 0], [0, 0, 1]],
  ["left", msg`Left`, [-1, 0, 0], [0, -1, 0], [0, 0, 1]],
];
