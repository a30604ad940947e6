/** The program: add actions, list them, problems, variables. */

import { msg } from "@lingui/core/macro";
import { lazyComponent } from "../kit/lazy";
import type { Tool } from "../workplace/tool";

export const program: Tool = {
  id: "program",
  label: msg`Program`,
  icon: "action",
  shown: (state) => state.doc?.project !== null && state.doc !== null,
  Panel: lazyComponent(() => import("./ProgramPanel")),
};
