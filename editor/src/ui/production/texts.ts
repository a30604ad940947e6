/** Names of the states of recipes and units, and of the activities of the cell. */

import type { MessageDescriptor } from "@lingui/core";
import { msg } from "@lingui/core/macro";
import type { Recipe, Unit } from "../../protocol/types";

export const RECIPE_STATES: Record<Recipe["state"], MessageDescriptor> = {
  draft: msg`Draft`,
  tested: msg`Tested`,
  released: msg`Released`,
  retired: msg`Retired`,
};
export const RECIPE_TONES: Record<Recipe["state"], string> = {
  draft: "",
  tested: "warn",
  released: "good",
  retired: "",
};
export const UNIT_STATES: Record<Unit["state"], MessageDescriptor> = {
  in_cell: msg`In the cell`,
  good: msg`Good`,
  bad: msg`Bad`,
  rejected: msg`Rejected`,
  unknown: msg`Unknown`,
};
export const UNIT_TONES: Record<Unit["state"], string> = {
  in_cell: "",
  good: "good",
  bad: "bad",
  rejected: "warn",
  unknown: "warn",
};
/** In the order of their display. */
export const ACTIVITIES: Record<string, MessageDescriptor> = {
  running: msg`Running`,
  held: msg`Held`,
  paused: msg`Paused`,
  starting: msg`Starting`,
  stopping: msg`Stopping`,
  idle: msg`Idle`,
  off: msg`Server off`,
};
