/** Pose of the selected item, and the ways to change it. */

import { msg } from "@lingui/core/macro";
import { lazily } from "../../kit/lazy";
import type { Section } from "../section";

export const place: Section = {
  id: "place",
  title: msg`Place`,
  applies: ({ kind, id }, state) =>
    kind === "point" || kind === "orientation" || state.doc?.objects[id]?.pose !== undefined,
  Body: lazily(() => import("../../transform/Place")),
};
