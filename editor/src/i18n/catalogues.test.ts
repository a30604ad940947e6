/** The catalogues of all languages. */

import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { formatter } from "@lingui/format-po";
import { describe, expect, test } from "vitest";
import { LANGUAGES, preferredLanguage } from "./catalogue";

const FOLDER = import.meta.dirname;

/** Return the texts of a catalogue: original and translation. */
async function textsOf(language: string): Promise<[string, string][]> {
  const content = readFileSync(join(FOLDER, `${language}.po`), "utf8");
  const context = { locale: language, sourceLocale: "en", filename: `${language}.po` };
  const catalogue = await formatter().parse(content, context);
  return Object.values(catalogue).map(({ message = "", translation = "" }) => [message, translation]);
}

const fields = (text: string): string[] => [
  ...new Set(Array.from(text.matchAll(/\{(\w+)(?=[,}])/g), ([, name]) => name ?? "")),
];
const mark = (text: string): string => /[.…:?]?$/.exec(text)?.[0] ?? "";

test("every language has a catalogue, and every catalogue a language", () => {
  const catalogues = readdirSync(FOLDER).filter((name) => name.endsWith(".po"));
  expect(catalogues.map((name) => name.slice(0, -3)).sort()).toEqual(Object.keys(LANGUAGES).sort());
});

describe.each(Object.keys(LANGUAGES))("the catalogue %s", (language) => {
  test("is complete, and its texts have the placeholders and the final punctuation of the originals", async () => {
    const texts = await textsOf(language);
    expect(texts.length).toBeGreaterThan(800);
    const wrong = texts.filter(
      ([original, translation]) =>
        translation === "" ||
        mark(original) !== mark(translation) ||
        fields(original).sort().join() !== fields(translation).sort().join(),
    );
    expect(wrong).toEqual([]);
  });

  test("has every plural form of the language", async () => {
    const { pluralCategories } = new Intl.PluralRules(language).resolvedOptions();
    const needed = pluralCategories.filter((each) => each !== "many"); // for fractions, which are not counted
    const plurals = (await textsOf(language)).filter(([, translation]) => translation.includes(", plural,"));
    expect(plurals.length).toBeGreaterThan(5);
    const wrong = plurals.filter(([, translation]) => !needed.every((form) => translation.includes(` ${form} {`)));
    expect(wrong).toEqual([]);
  });
});

test("the first language of the browser that has a catalogue is used, else English", () => {
  expect(preferredLanguage(["fr-CA", "de-AT", "cs"])).toBe("de");
  expect(preferredLanguage(["fr"])).toBe("en");
});
