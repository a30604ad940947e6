/** The program: add actions, its steps in order, what is wrong with it, its parameters. */

import { msg } from "@lingui/core/macro";
import { lazily } from "../kit/lazily";
import type { Tool } from "../workplace/tool";

export const program: Tool = {
  id: "program",
  label: msg`Program`,
  icon: "action",
  shown: (state) => state.doc?.project !== null && state.doc !== null,
  Panel: lazily(() => import("./ProgramPanel")),
};
