/** The list of all that is in the workplace. */

import { lazy } from "react";
import type { Tool } from "../tools";

export const things: Tool = { id: "things", label: "Things", icon: "tree", Panel: lazy(() => import("./ThingsPanel")) };
