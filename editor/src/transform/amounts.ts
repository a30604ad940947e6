/** Lengths and angles as people write them: with units, as sums, as changes of what is there. All values are in m and rad. */

export type LengthUnit = "m" | "cm" | "mm" | "in";
export type AngleUnit = "°" | "rad";
export type Unit = LengthUnit | AngleUnit;
export type Quantity = "length" | "angle";

export const LENGTH_UNITS: readonly LengthUnit[] = ["mm", "cm", "m", "in"];
export const ANGLE_UNITS: readonly AngleUnit[] = ["°", "rad"];

/** What one of it is in m or rad. */
export const WORTH: Record<Unit, number> = { m: 1, cm: 0.01, mm: 0.001, in: 0.0254, "°": Math.PI / 180, rad: 1 };
/** Digits after the point that are worth showing: 10 µm, a thousandth of a degree. */
export const DIGITS: Record<Unit, number> = { m: 5, cm: 3, mm: 2, in: 4, "°": 3, rad: 5 };

/** Other ways to write a unit. */
const ALIASES: Record<string, Unit> = { '"': "in", inch: "in", deg: "°", d: "°" };
/** Parts of a degree, told by their marks. */
const MINUTE = "′";
const SECOND = "″";

export function show(value: number, unit: Unit): string {
  const text = (value / WORTH[unit]).toFixed(DIGITS[unit]).replace(/\.?0+$/, "");
  return text === "-0" ? "0" : text;
}

/**
 * Read what somebody typed: `12.5`, `3cm`, `1in/2`, `10 + 2.5mm`. With a sign of change (`+12.5`, `-=3mm`), or where
 * `by` says that a change is meant, it is added to what is there. Gives null for what is no amount.
 */
export function amount(text: string, now: number, unit: Unit, by = false): number | null {
  const clean = text.trim().replaceAll(",", ".").replaceAll("−", "-");
  const change = /^(\+=?|-=)/.exec(clean);
  const value = sum(change ? clean.slice(change[0].length) : clean, unit);
  if (value === null) return null;
  if (change) return now + (change[0] === "-=" ? -value : value);
  return by ? now + value : value;
}

/** A sum of terms, each with a unit of its own or the one that is set. */
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
  const worth = worthOf(named ?? "", unit);
  if (worth === null) return null;
  let value = Number(number) * worth * (sign === "-" ? -1 : 1);
  if (operator === "*") value *= Number(by);
  if (operator === "/") value /= Number(by);
  return Number.isFinite(value) ? value : null;
}

/** What the written unit is worth; null when it is none, or measures something else. */
function worthOf(named: string, unit: Unit): number | null {
  if (!named) return WORTH[unit];
  const angle = isAngle(unit);
  if (angle && (named === MINUTE || named === "'")) return WORTH["°"] / 60;
  if (angle && (named === SECOND || named === '"')) return WORTH["°"] / 3600;
  const written = ALIASES[named.toLowerCase()] ?? (named.toLowerCase() as Unit);
  return written in WORTH && isAngle(written) === angle ? WORTH[written] : null;
}

export function isAngle(unit: Unit): unit is AngleUnit {
  return unit === "°" || unit === "rad";
}

/** Steps of the wheel, m and rad, with what they are called. */
export const LENGTH_STEPS: readonly (readonly [number, string])[] = [
  [0.1, "10 cm"],
  [0.05, "5 cm"],
  [0.01, "1 cm"],
  [0.001, "1 mm"],
  [0.0001, "0.1 mm"],
];
export const ANGLE_STEPS: readonly (readonly [number, string])[] = [
  [Math.PI / 4, "45°"],
  [Math.PI / 18, "10°"],
  [Math.PI / 180, "1°"],
  [Math.PI / 180 / 60, "1′"],
  [Math.PI / 180 / 3600, "1″"],
];

/** A step as words: the table's, or the free value. */
export function stepWords(step: number, quantity: Quantity): string {
  const steps = quantity === "length" ? LENGTH_STEPS : ANGLE_STEPS;
  const known = steps.find(([value]) => Math.abs(value - step) < 1e-12);
  return known?.[1] ?? (quantity === "length" ? `${show(step, "mm")} mm` : `${show(step, "°")}°`);
}
