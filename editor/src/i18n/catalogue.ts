/**
 * The texts of the interface in the user's language: one catalogue per language, loaded before the page is shown.
 * Constants of modules use descriptors (`msg`), since modules are evaluated before the catalogue is loaded; `i18n._()`
 * turns them into text.
 */

import { i18n, type Messages } from "@lingui/core";
import { loadTranslations } from "./serverMessages";

const CATALOGUES: Readonly<Record<string, () => Promise<{ messages: Messages }>>> = {
  en: () => import("./en.po"),
};
const FALLBACK = "en";

/** Return the first language of the browser that has a catalogue, else English. */
export function preferredLanguage(languages: readonly string[] = navigator.languages): string {
  const short = languages.map((each) => each.split("-")[0] ?? "");
  return short.find((each) => each in CATALOGUES) ?? FALLBACK;
}

/** Load the texts of a language and use them. To change the language, reload the page. */
export async function loadCatalogue(language: string): Promise<void> {
  const load = CATALOGUES[language] ?? CATALOGUES[FALLBACK];
  if (!load) return;
  const [{ messages }] = await Promise.all([load(), loadTranslations(language).catch(() => {})]);
  i18n.loadAndActivate({ locale: language, messages });
  document.documentElement.lang = language;
}
