/** The tools of the rail on the left, from top to bottom. */

import { points } from "../points/tool";
import { program } from "../program/tool";
import { run } from "../run/tool";
import { add } from "../scene/tool";
import type { Tool } from "./tool";
import { devices } from "./tools/devices";
import { robot } from "./tools/robot";
import { things } from "./tools/things";

export const TOOLS: readonly Tool[] = [things, add, robot, points, program, run, devices];
