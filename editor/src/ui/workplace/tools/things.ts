/** The object list. */

import { msg } from "@lingui/core/macro";
import { lazyComponent } from "../../kit/lazy";
import type { Tool } from "../tool";

export const things: Tool = {
  id: "things",
  label: msg`Objects`,
  icon: "tree",
  Panel: lazyComponent(() => import("../../things/ThingsPanel")),
};
