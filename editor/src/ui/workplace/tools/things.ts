/** The list of all that is in the workplace. */

import { lazily } from "../../kit/lazily";
import type { Tool } from "../tools";

export const things: Tool = {
  id: "things",
  label: "Things",
  icon: "tree",
  Panel: lazily(() => import("../../things/ThingsPanel")),
};
