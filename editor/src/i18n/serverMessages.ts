/** Texts of the server in the user's language: its messages, and the texts of object types. */

import { i18n, type Messages } from "@lingui/core";
import { decimalPoint } from "../formats";

/** A message of the server: the English text and what is needed to translate it. */
export interface ServerMessage {
  text: string;
  /** Template of the text with fields like `{name}`; the text itself if omitted. */
  key?: string | undefined;
  /** Values of the fields: texts, or messages that are part of this one. */
  values?: Readonly<Record<string, string | ServerMessage>> | undefined;
}

/** Translations by language and English text or template. */
export type Translations = Readonly<Record<string, Readonly<Record<string, string>>>>;

/** An alarm of a device. */
interface TranslatableAlarm {
  text: string;
  remedy: string;
  text_message?: ServerMessage;
  remedy_message?: ServerMessage;
}

/** Fields of events that contain a message. */
const FIELDS = ["message", "reason", "error"] as const;
/** Prefix of the server's texts in the catalogue. */
const SERVER = "server:";
/** A value that is a decimal number, with or without a unit or a sign of percent: the server writes a decimal point. */
const DECIMAL = /^([-+]?\d+)\.(\d+)(?=(?: ?[%°\p{L}/²³]*)?$)/u;
/** Names of fields whose values are shown as text, also if they look like numbers. */
const VERSION = /version|firmware/;

/** Return translations of the server, by English text or template, as part of a catalogue. */
export function serverCatalogue(translations: Readonly<Record<string, string>>): Messages {
  return Object.fromEntries(Object.entries(translations).map(([text, translated]) => [SERVER + text, translated]));
}

function translated(text: string, own: Translations): string {
  const found = i18n.messages[SERVER + text];
  return typeof found === "string" ? found : (own[i18n.locale]?.[text] ?? text);
}

/**
 * Return a message in the user's language as far as it is translated, else in English. `own` are translations that
 * came with it; those of the server have precedence.
 */
export function translate({ text, key, values }: ServerMessage, own: Translations = {}): string {
  if (key === undefined || values === undefined) return translated(text, own);
  return translated(key, own).replace(/\{\{|\}\}|\{(\w+)\}/g, (found, name?: string) => {
    if (name === undefined) return found.charAt(0);
    const value = values[name] ?? found;
    if (typeof value !== "string") return translate(value, own);
    return VERSION.test(name) ? value : value.replace(DECIMAL, `$1${decimalPoint()}$2`);
  });
}

/** Return an alarm with its text and remedy in the user's language. */
export function translatedAlarm<Alarm extends TranslatableAlarm>(alarm: Alarm): Alarm {
  const { text, remedy, text_message, remedy_message } = alarm;
  return { ...alarm, text: translate(text_message ?? { text }), remedy: translate(remedy_message ?? { text: remedy }) };
}

/** The data of an event. */
interface Translatable extends Omit<ServerMessage, "text"> {
  /** The title of a task. */
  title_message?: ServerMessage;
  [field: string]: unknown;
}

/** Return the data of an event with its message in the user's language. */
export function inUserLanguage<Data>(data: Data): Data {
  if (typeof data !== "object" || data === null) return data;
  const { key, values, title_message, ...texts } = data as Translatable;
  const field = FIELDS.find((each) => typeof texts[each] === "string");
  const title = title_message && { title: translate(title_message) };
  return field || title
    ? { ...data, ...title, ...(field && { [field]: translate({ text: texts[field] as string, key, values }) }) }
    : data;
}
