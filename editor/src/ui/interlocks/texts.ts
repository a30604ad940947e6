/** Conditions of interlocks in words. */

import { t } from "@lingui/core/macro";
import { words } from "../../program/naming";
import type { Need } from "../../protocol/types";

const SIGNS: Record<string, string> = { "==": "=", "!=": "≠", "<=": "≤", ">=": "≥", "<": "<", ">": ">" };

/** Return a condition as users read it, such as `tester: door open`. */
export function needText(need: Need, object: string): string {
  const name = need.point || words(need.observation);
  if (need.operator === "==" && need.value === "true") return t`${object}: ${name}`;
  if (need.operator === "==" && need.value === "false") return t`${object}: not ${name}`;
  const value = need.value?.replaceAll('"', "") ?? "";
  if (need.upper !== undefined) return t`${object}: ${name} from ${value} to ${need.upper}`;
  const sign = SIGNS[need.operator ?? "=="] ?? "";
  return t`${object}: ${name} ${sign} ${value}`;
}
