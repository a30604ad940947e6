/** Points of the project: to add them, and what there is. */

import { lazily } from "../kit/lazily";
import type { Tool } from "../workplace/tools";

export const points: Tool = {
  id: "points",
  label: "Points",
  icon: "point",
  shown: (state) => state.doc?.project != null,
  Panel: lazily(() => import("./PointsPanel")),
};
