/** Names of the priorities of alarms. */

import type { MessageDescriptor } from "@lingui/core";
import { msg } from "@lingui/core/macro";
import type { Priority } from "../../protocol/types";

export const PRIORITIES: Record<Priority, MessageDescriptor> = {
  urgent: msg`urgent`,
  high: msg`high`,
  medium: msg`medium`,
  low: msg`low`,
};
