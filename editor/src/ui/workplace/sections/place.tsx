/** Pose of the selected item, and its controls. */

import { msg } from "@lingui/core/macro";
import { lazyComponent } from "../../kit/lazy";
import type { Section } from "../section";

export const place: Section = {
  id: "place",
  title: msg`Place`,
  applies: ({ kind, id }, state) =>
    kind === "point" || kind === "orientation" || state.doc?.objects[id]?.pose !== undefined,
  Body: lazyComponent(() => import("../../transform/Place")),
};
