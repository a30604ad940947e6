/** Lengths and angles as users type them: with units, sums and relative changes. All values are in m and rad. */

import { decimal, normalised } from "../formats";
export type LengthUnit = "m" | "cm" | "mm" | "in";
export type AngleUnit = "°" | "rad";
export type Unit = LengthUnit | AngleUnit;
type Quantity = "length" | "angle";

export const LENGTH_UNITS: readonly LengthUnit[] = ["mm", "cm", "m", "in"];
export const ANGLE_UNITS: readonly AngleUnit[] = ["°", "rad"];

/** The value of one unit in m or rad. */
export const UNIT_FACTORS: Record<Unit, number> = { m: 1, cm: 0.01, mm: 0.001, in: 0.0254, "°": Math.PI / 180, rad: 1 };
/** Useful number of decimals: 10 µm, 0.001°. */
export const DIGITS: Record<Unit, number> = { m: 5, cm: 3, mm: 2, in: 4, "°": 3, rad: 5 };

/** Other spellings of units. */
const ALIASES: Record<string, Unit> = { '"': "in", inch: "in", deg: "°", d: "°" };
/** Minutes and seconds of arc. */
const MINUTE = "′";
const SECOND = "″";

/** Return a length or angle, m or rad, as a number in a unit. */
export function amountText(value: number, unit: Unit): string {
  return decimal(value / UNIT_FACTORS[unit], DIGITS[unit]);
}

/**
 * Read a typed amount: `12.5`, `3cm`, `1in/2`, `10 + 2.5mm`. With a sign (`+12.5`, `-=3mm`), or if `relative` is set,
 * it is added to the present value. Return null if it is invalid.
 */
export function parseAmount(text: string, current: number, unit: Unit, relative = false): number | null {
  const clean = normalised(text);
  const change = /^(\+=?|-=)/.exec(clean);
  const value = sum(change ? clean.slice(change[0].length) : clean, unit);
  if (value === null) return null;
  if (change) return current + (change[0] === "-=" ? -value : value);
  return relative ? current + value : value;
}

/** A sum of terms, each with its own unit or the current one. */
function sum(text: string, unit: Unit): number | null {
  const terms = text.match(/[+-]?[^+-]+/g);
  if (!terms || terms.join("") !== text) return null;
  let total = 0;
  for (const each of terms) {
    const value = term(each, unit);
    if (value === null) return null;
    total += value;
  }
  return total;
}

function term(text: string, unit: Unit): number | null {
  const parts = /^([+-]?)\s*(\d+\.?\d*|\.\d+)\s*([a-z"°′″']*)\s*(?:([*/])\s*(\d+\.?\d*|\.\d+))?\s*$/i.exec(text.trim());
  if (!parts) return null;
  const [, sign, number, named, operator, by] = parts;
  const factor = unitFactor(named ?? "", unit);
  if (factor === null) return null;
  let value = Number(number) * factor * (sign === "-" ? -1 : 1);
  if (operator === "*") value *= Number(by);
  if (operator === "/") value /= Number(by);
  return Number.isFinite(value) ? value : null;
}

/** Return the value of a typed unit; null if it is unknown or of another quantity. */
function unitFactor(named: string, unit: Unit): number | null {
  if (!named) return UNIT_FACTORS[unit];
  const angle = isAngle(unit);
  if (angle && (named === MINUTE || named === "'")) return UNIT_FACTORS["°"] / 60;
  if (angle && (named === SECOND || named === '"')) return UNIT_FACTORS["°"] / 3600;
  const written = ALIASES[named.toLowerCase()] ?? (named.toLowerCase() as Unit);
  return written in UNIT_FACTORS && isAngle(written) === angle ? UNIT_FACTORS[written] : null;
}

export function isAngle(unit: Unit): unit is AngleUnit {
  return unit === "°" || unit === "rad";
}

/** Steps of the wheel: m or rad, and the number and unit that name them. */
export const LENGTH_STEPS: readonly (readonly [number, number, string])[] = [
  [0.1, 10, " cm"],
  [0.05, 5, " cm"],
  [0.01, 1, " cm"],
  [0.001, 1, " mm"],
  [0.0001, 0.1, " mm"],
];
export const ANGLE_STEPS: readonly (readonly [number, number, string])[] = [
  [Math.PI / 4, 45, "°"],
  [Math.PI / 18, 10, "°"],
  [Math.PI / 180, 1, "°"],
  [Math.PI / 180 / 60, 1, MINUTE],
  [Math.PI / 180 / 3600, 1, SECOND],
];

/** Return the name of a step. */
export function stepWords(step: number, quantity: Quantity): string {
  const steps = quantity === "length" ? LENGTH_STEPS : ANGLE_STEPS;
  const known = steps.find(([value]) => Math.abs(value - step) < 1e-12);
  if (known) return `${decimal(known[1])}${known[2]}`;
  return quantity === "length" ? `${amountText(step, "mm")} mm` : `${amountText(step, "°")}°`;
}
