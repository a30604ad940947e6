/** The values of a recipe for the next run. Pure functions. */

import { t } from "@lingui/core/macro";
import { decimal, numberFrom } from "../../formats";
import type { Recipe, RecipeValue } from "../../protocol/types";

/** Return whether a run may use another value, which has to be within the limits. */
export const canDiffer = ({ min, max }: RecipeValue): boolean => min !== undefined || max !== undefined;

/** Return a value as it is shown. */
export function shownValue({ value }: RecipeValue): string {
  const plain: unknown = JSON.parse(value);
  if (typeof plain === "boolean") return plain ? t`yes` : t`no`;
  return typeof plain === "number" ? decimal(plain, 6) : String(plain);
}

/** Return the limits of a value in words. */
export function limitsOf({ min, max }: RecipeValue): string {
  if (max === undefined) return t`at least ${decimal(min ?? 0, 6)}`;
  if (min === undefined) return t`at most ${decimal(max, 6)}`;
  return t`${decimal(min, 6)} to ${decimal(max, 6)}`;
}

/** The values of the next run in place of those of the recipe, JSON by name, or the reason why it cannot start. */
export interface RunValues {
  values: Record<string, string>;
  problem: string;
}

/** Check what a person has entered; empty texts keep the value of the recipe. */
export function runValues(recipe: Recipe, texts: Readonly<Record<string, string>>): RunValues {
  const values: Record<string, string> = {};
  for (const each of recipe.values.filter(canDiffer)) {
    const text = texts[each.name]?.trim();
    if (!text) continue;
    const number = numberFrom(text);
    const { name } = each;
    const limits = limitsOf(each);
    if (!(number >= (each.min ?? -Infinity) && number <= (each.max ?? Infinity)))
      return { values: {}, problem: t`${name} must be a number: ${limits}.` };
    values[name] = JSON.stringify(number);
  }
  return { values, problem: "" };
}
