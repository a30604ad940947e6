/** Adds devices, shapes and meshes to the scene. */

import { lazily } from "../kit/lazily";
import type { Tool } from "../workplace/tools";

export const add: Tool = {
  id: "add",
  label: "Add",
  icon: "plus",
  shown: (state) => state.doc !== null && state.doc.project === null,
  Panel: lazily(() => import("./AddPanel")),
};
