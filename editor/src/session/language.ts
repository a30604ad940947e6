/** The language of the user: stored on the server for all devices, and in this browser for the screen before login. */

import { i18n } from "@lingui/core";
import { isLanguage, type Language, loadCatalogue } from "../i18n/catalogue";
import type { State } from "../store/state";
import type { Follower } from "./follower";
import { remember } from "./localStorage";

/** Key in the general view state of the user. */
export const LANGUAGE = "language";

/** Show the page in a language, now and when it is opened again. */
export async function displayIn(language: Language): Promise<void> {
  remember("language", language);
  if (language !== i18n.locale) await loadCatalogue(language);
}

/** Shows the page in the language that the user has chosen, here or on another device. */
export class LanguageFollower implements Follower {
  private wanted: unknown;

  /** `retranslate` requests again what the server's texts are part of. */
  constructor(retranslate: () => void) {
    i18n.on("change", retranslate);
  }

  reset(): void {
    this.wanted = undefined;
  }

  follow(state: State): void {
    const wanted = state.view.general[LANGUAGE];
    if (wanted === this.wanted) return;
    this.wanted = wanted;
    if (isLanguage(wanted)) displayIn(wanted).catch(() => {}); // offline: the present language stays
  }
}
