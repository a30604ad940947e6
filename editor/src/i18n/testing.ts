/** Set-up of the unit tests: use the English texts of the source code. */

import { i18n } from "@lingui/core";

i18n.loadAndActivate({ locale: "en", messages: {} });
