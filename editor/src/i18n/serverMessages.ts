/** Messages of the server in the user's language. */

import { i18n } from "@lingui/core";

/** A message of the server: the English text and, from servers that support it, what is needed to translate it. */
export interface ServerMessage {
  text: string;
  /** Key of the message in the catalogues, without the prefix. */
  key?: string | undefined;
  /** Values of its placeholders. */
  values?: Readonly<Record<string, string | number>> | undefined;
}

/** Prefix of the ids of server messages in the catalogues. */
export const PREFIX = "server.";

/** Return a message in the user's language if the catalogue contains its key, else the English text of the server. */
export function translate({ text, key, values = {} }: ServerMessage): string {
  const id = `${PREFIX}${key}`;
  return key !== undefined && id in i18n.messages ? i18n._(id, values) : text;
}
