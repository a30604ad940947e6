/** Texts of the server in the user's language: its messages, and the texts of object types. */

/** A message of the server: the English text and what is needed to translate it. */
export interface ServerMessage {
  text: string;
  /** Template of the text with fields like `{name}`; the text itself if omitted. */
  key?: string | undefined;
  /** Values of the fields: texts, or messages that are part of this one. */
  values?: Readonly<Record<string, string | ServerMessage>> | undefined;
}

const SOURCE_LANGUAGE = "en";
/** Fields of events that contain a message. */
const FIELDS = ["message", "reason", "error"] as const;
let translations: Readonly<Record<string, string>> = {};

/** Use these translations, by English text or template. */
export function setTranslations(found: Readonly<Record<string, string>>): void {
  translations = found;
}

/** Load the translations of the server and its drivers. */
export async function loadTranslations(language: string): Promise<void> {
  if (language === SOURCE_LANGUAGE) return setTranslations({});
  const response = await fetch(`/api/translations/${language}`);
  setTranslations(response.ok ? ((await response.json()) as Record<string, string>) : {});
}

/** Return a message in the user's language as far as it is translated, else in English. */
export function translate({ text, key, values }: ServerMessage): string {
  if (key === undefined || values === undefined) return translations[text] ?? text;
  return (translations[key] ?? key).replace(/\{\{|\}\}|\{(\w+)\}/g, (found, name?: string) => {
    if (name === undefined) return found.charAt(0);
    const value = values[name] ?? found;
    return typeof value === "string" ? value : translate(value);
  });
}

/** Return the data of an event with its message in the user's language. */
export function inUserLanguage<Data>(data: Data): Data {
  if (typeof data !== "object" || data === null) return data;
  const { key, values, ...texts } = data as Omit<ServerMessage, "text"> & Partial<Record<string, unknown>>;
  const field = FIELDS.find((each) => typeof texts[each] === "string");
  return field ? { ...data, [field]: translate({ text: texts[field] as string, key, values }) } : data;
}
