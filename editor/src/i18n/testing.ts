/** Set-up of the unit tests: use the English texts of the source code. */

// Imported before a test replaces `document`, which it examines: test files share one process and have no fixed order.
import "react-aria-components";
import { i18n } from "@lingui/core";
import { serverCatalogue } from "./serverMessages";

/** Use these translations of the server's texts, by English text or template. */
export function setTranslations(translations: Record<string, string>, locale = "en"): void {
  i18n.loadAndActivate({ locale, messages: serverCatalogue(translations) });
}

setTranslations({});
