/**
 * The tools of the left rail: at most six, each an icon and a word. A tool is a folder beside this file that exports
 * one of these; its panel stands at the right while it is open.
 */

import type { MessageDescriptor } from "@lingui/core";
import type { ComponentType } from "react";
import type { State } from "../../store/state";
import type { IconName } from "../kit/icons";
import { points } from "../points/tool";
import { program } from "../program/tool";
import { run } from "../run/tool";
import { add } from "../scene/tool";
import { devices } from "./tools/devices";
import { robot } from "./tools/robot";
import { things } from "./tools/things";

export interface Tool {
  id: string;
  label: MessageDescriptor;
  icon: IconName;
  /** Absent from the rail while this is false: what makes no sense in a scene, say. */
  shown?: (state: State) => boolean;
  /** Why it cannot be used now, as a sentence; empty when it can. */
  barred?: (state: State) => string;
  Panel: ComponentType;
}

export const TOOLS: readonly Tool[] = [things, add, robot, points, program, run, devices];
