/** The object list. */

import { msg } from "@lingui/core/macro";
import { lazily } from "../../kit/lazy";
import type { Tool } from "../tool";

export const things: Tool = {
  id: "things",
  label: msg`Objects`,
  icon: "tree",
  Panel: lazily(() => import("../../things/ThingsPanel")),
};
