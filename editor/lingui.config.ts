import { defineConfig } from "@lingui/conf";
import { formatter } from "@lingui/format-po";
import { createSwcExtractor } from "@lingui/native-tools";

/** English is the source language. To add a language, see docs/how-to/translate.md. */
export default defineConfig({
  sourceLocale: "en",
  locales: ["en", "cs", "de"],
  catalogs: [
    {
      path: "<rootDir>/src/i18n/{locale}",
      include: ["<rootDir>/src"],
      exclude: ["**/*.test.*", "**/protocol/types.ts"],
    },
  ],
  format: formatter({ lineNumbers: false, printPlaceholdersInComments: true }),
  orderBy: "message",
  extractors: [createSwcExtractor()],
});
