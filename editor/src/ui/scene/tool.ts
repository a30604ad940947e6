/** Add devices, shapes and meshes to the scene. In a project, the list of objects opens it. */

import { msg } from "@lingui/core/macro";
import { lazyComponent } from "../kit/lazy";
import type { Tool } from "../workplace/tool";

export const add: Tool = {
  id: "add",
  label: msg`Add`,
  icon: "plus",
  shown: (state) => state.doc !== null && state.doc.project === null,
  Panel: lazyComponent(() => import("./AddPanel")),
};
