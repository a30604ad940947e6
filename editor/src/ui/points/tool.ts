/** Points of the project: list and add. */

import { msg } from "@lingui/core/macro";
import { lazyComponent } from "../kit/lazy";
import type { Tool } from "../workplace/tool";

export const points: Tool = {
  id: "points",
  label: msg`Points`,
  icon: "point",
  shown: (state) => state.doc?.project != null,
  Panel: lazyComponent(() => import("./PointsPanel")),
};
