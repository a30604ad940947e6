/** Run the program: start, follow, trace, history. */

import { msg } from "@lingui/core/macro";
import { lazyComponent } from "../kit/lazy";
import type { Tool } from "../workplace/tool";

export const run: Tool = {
  id: "run",
  label: msg({ message: "Run", context: "tool" }),
  icon: "play",
  shown: (state) => state.doc?.project != null,
  Panel: lazyComponent(() => import("./RunPanel")),
};
