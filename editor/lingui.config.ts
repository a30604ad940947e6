import { defineConfig } from "@lingui/conf";
import { formatter } from "@lingui/format-po";
import { createSwcExtractor } from "@lingui/native-tools";

/** English is the source language. To add a language, add its locale here and run `npm run extract`. */
export default defineConfig({
  sourceLocale: "en",
  locales: ["en"],
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
