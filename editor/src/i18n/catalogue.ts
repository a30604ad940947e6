/**
 * The texts of the interface in the user's language: a catalogue per language, loaded when it is needed. Constants of
 * modules use descriptors (`msg`), since modules are evaluated before the catalogue is loaded; `i18n._()` turns them
 * into text.
 */

import { i18n, type Messages } from "@lingui/core";
import { useSyncExternalStore } from "react";
import { rest } from "../session/rest";
import { serverCatalogue } from "./serverMessages";

/** The languages by their own names. */
export const LANGUAGES = { en: "English", cs: "Čeština", de: "Deutsch" } as const;
export type Language = keyof typeof LANGUAGES;

const CATALOGUES: Readonly<Record<Language, () => Promise<{ messages: Messages }>>> = {
  en: () => import("./en.po"),
  cs: () => import("./cs.po"),
  de: () => import("./de.po"),
};
/** The language of the source code, for which the server has no translations. */
const FALLBACK: Language = "en";
/** Time limit for loading the server's translations, s. After it, the page shows the server's texts in English. */
const TRANSLATIONS_DEADLINE = 5;

export function isLanguage(name: unknown): name is Language {
  return typeof name === "string" && name in LANGUAGES;
}

/** Return the first language of the browser that has a catalogue, else English. */
export function preferredLanguage(languages: readonly string[] = navigator.languages): Language {
  return languages.map((each) => each.split("-")[0]).find(isLanguage) ?? FALLBACK;
}

/** Load the translations of the server and its drivers as part of a catalogue. */
async function loadTranslations(language: Language): Promise<Messages> {
  if (language === FALLBACK) return {};
  const response = await rest(`/api/translations/${language}`, { deadline: TRANSLATIONS_DEADLINE });
  return serverCatalogue((await response.json()) as Record<string, string>);
}

/** Load the texts of a language and use them. */
export async function loadCatalogue(language: Language): Promise<void> {
  const [{ messages }, server] = await Promise.all([
    CATALOGUES[language](),
    loadTranslations(language).catch(() => ({})),
  ]);
  document.documentElement.lang = language;
  i18n.loadAndActivate({ locale: language, messages: { ...messages, ...server } });
}

/** Return the language in use; the component is drawn again when it changes. */
export function useLanguage(): Language {
  return useSyncExternalStore(
    (changed) => i18n.on("change", changed),
    () => i18n.locale as Language,
  );
}
