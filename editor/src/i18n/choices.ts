/** Options of fields whose texts are message descriptors. */

import { i18n, type MessageDescriptor } from "@lingui/core";

/** Return the choices with their texts in the user's language. */
export function translated<Key>(choices: readonly (readonly [Key, MessageDescriptor])[]): (readonly [Key, string])[] {
  return choices.map(([key, text]) => [key, i18n._(text)]);
}
