/** Choose the language. */

import { t } from "@lingui/core/macro";
import type { Language } from "../i18n/catalogue";
import { displayIn, LANGUAGE } from "../session/language";
import { notify } from "../store/store";
import { storeGeneralState } from "./viewstate";

/** Show the page in a language, and store it for all devices of the user. */
export function chooseLanguage(language: Language): void {
  storeGeneralState({ [LANGUAGE]: language });
  displayIn(language).catch(() => notify("error", t`The language cannot be loaded.`));
}
