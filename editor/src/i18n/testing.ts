/** Set-up of the unit tests: the English texts as they are written in the source code. */

import { i18n } from "@lingui/core";

i18n.loadAndActivate({ locale: "en", messages: {} });
