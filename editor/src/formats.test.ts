/** Numbers, times and order of names in other languages. */

import { i18n } from "@lingui/core";
import { afterEach, describe, expect, test } from "vitest";
import { ago, byName, compareTexts, decimal, decimalPoint, duration, fixed, numberFrom } from "./formats";
import { setTranslations } from "./i18n/testing";
import { parseValue, textOf } from "./program/values";
import { amountText, stepWords } from "./transform/amounts";

const use = (locale: string) => i18n.loadAndActivate({ locale, messages: {} });

afterEach(() => setTranslations({}));

describe.each(["cs", "de"])("in %s", (language) => {
  test("numbers have a decimal comma and no thousands separator", () => {
    use(language);
    expect([fixed(1234.5, 2), decimal(0.1 + 0.2), decimal(-12), decimalPoint()]).toEqual([
      "1234,50",
      "0,30000000000000004",
      "-12",
      ",",
    ]);
    expect([fixed(-0.001, 1), amountText(0.0125, "mm"), stepWords(0.0001, "length")]).toEqual([
      "0,0",
      "12,5",
      "0,1 mm",
    ]);
    expect([textOf("double", "1.5"), textOf("integer", "1500")]).toEqual(["1,5", "1500"]);
    expect([duration(0.25), duration(3.25), duration(59.7)]).toEqual(["250 ms", "3,3 s", "1 min 0 s"]);
  });

  test("shown numbers can be read again", () => {
    use(language);
    expect(parseValue("double", textOf("double", "1.5"))).toEqual({ json: "1.5" });
    expect(numberFrom(fixed(-1234.5, 2))).toBe(-1234.5);
  });
});

test("the format follows the language", () => {
  const before = () => ago("2026-01-01T12:00:00Z", Date.parse("2026-01-02T12:05:00Z"));
  expect([decimal(0.5), before()]).toEqual(["0.5", "yesterday"]);
  use("de");
  expect([decimal(0.5), before()]).toEqual(["0,5", "gestern"]);
});

test("both commas and points are accepted in numbers, but not two of them", () => {
  expect([numberFrom(" 1,5 "), numberFrom("−1.5"), numberFrom("1.000,5"), numberFrom(""), numberFrom("x")]).toEqual([
    1.5,
    -1.5,
    Number.NaN,
    Number.NaN,
    Number.NaN,
  ]);
});

test("names are in the order of a dictionary, and numbers in them by value", () => {
  use("cs");
  expect(["Zebra", "chata", "Čáp", "cihla", "hora", "a10", "a9"].sort(compareTexts)).toEqual([
    "a9",
    "a10",
    "cihla",
    "Čáp",
    "hora",
    "chata",
    "Zebra",
  ]);
  expect([{ name: "b" }, { name: "A" }].sort(byName)[0]?.name).toBe("A");
});
