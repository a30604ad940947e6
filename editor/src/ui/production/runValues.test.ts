import { expect, test } from "vitest";
import type { Recipe, RecipeValue } from "../../protocol/types";
import { limitsOf, runValues, shownValue } from "./runValues";
import "../../i18n/testing";

const SPEED: RecipeValue = { name: "speed", value: "0.25", min: 0.1, max: 0.4 };
const FIXED: RecipeValue = { name: "text", value: '"A-1"' };
const RECIPE = { values: [SPEED, FIXED] } as unknown as Recipe;

test("values and limits are shown in words", () => {
  expect([SPEED, FIXED, { name: "on", value: "true" }].map(shownValue)).toEqual(["0.25", "A-1", "yes"]);
  expect(limitsOf(SPEED)).toBe("0.1 to 0.4");
  expect(limitsOf({ name: "speed", value: "1", min: 0 })).toBe("at least 0");
  expect(limitsOf({ name: "speed", value: "1", max: 2 })).toBe("at most 2");
});

test("a run uses other values only within the limits of the recipe", () => {
  expect(runValues(RECIPE, {})).toEqual({ values: {}, problem: "" });
  expect(runValues(RECIPE, { speed: " 0,3 ", text: "ignored" })).toEqual({ values: { speed: "0.3" }, problem: "" });
  expect(runValues(RECIPE, { speed: " " }).values).toEqual({});
  for (const speed of ["0.5", "0", "fast"])
    expect(runValues(RECIPE, { speed })).toEqual({ values: {}, problem: "speed must be a number: 0.1 to 0.4." });
});
