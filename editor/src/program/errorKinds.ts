/** The kinds of errors that an error exit can name. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, plural, t } from "@lingui/core/macro";

/** The kind that contains all others. */
export const ANY = "error";

/** Names of the kinds. Any error comes last, as its exit is followed only if no other one is. */
export const KIND_NAMES: Readonly<Record<string, MessageDescriptor>> = {
  refused: msg`Refused`,
  device_timeout: msg`Timeout`,
  device_fault: msg`Device fault`,
  out_of_range: msg`Out of range`,
  stale: msg`Value too old`,
  no_depth: msg`No depth`,
  overexposed: msg`Overexposed`,
  path_blocked: msg`Path blocked`,
  kinematics: msg`Not reachable`,
  [ANY]: msg`Any other error`,
};

/** Return the name of a kind in the language of the user. */
export function kindWords(kind: string): string {
  const known = KIND_NAMES[kind];
  return known ? i18n._(known) : kind;
}

/** Return the text of an error exit at its line: "on error: Refused". */
export function errorWords(kinds: readonly string[]): string {
  const [only = ANY] = kinds;
  if (kinds.length > 1) return plural(kinds.length, { one: "on error: # kind", other: "on error: # kinds" });
  return only === ANY ? t`on error` : t`on error: ${kindWords(only)}`;
}
