/** Values of parameters: written, read and checked before they are sent. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { decimal, numberFrom } from "../formats";
import type { ActionParameter, ParameterMeta } from "../protocol/types";
import { decoded } from "./json";

/** Additional data of a parameter. */
export interface Extra {
  minimum?: number;
  maximum?: number;
  allowed_values?: (number | string)[];
  unit?: string;
}

/** Units as users see them, and the factor from the stored unit: millimetres, degrees and seconds everywhere. */
const SHOWN: Record<string, readonly [unit: string, factor: number]> = {
  m: ["mm", 1000],
  "m/s": ["mm/s", 1000],
  "m/s²": ["mm/s²", 1000],
  rad: ["°", 180 / Math.PI],
  "rad/s": ["°/s", 180 / Math.PI],
  "rad/s²": ["°/s²", 180 / Math.PI],
  deg: ["°", 1],
  degrees: ["°", 1],
  ms: ["s", 0.001],
};

/** Return the unit that users see for a number, and the factor from the stored value. A ratio is a percentage. */
export function shownUnit(type: string, { unit = "", minimum, maximum }: Extra): readonly [string, number] {
  if (type !== "double" && type !== "integer") return [unit, 1];
  if (type === "double" && !unit && minimum !== undefined && minimum >= 0 && maximum === 1) return ["%", 100];
  return SHOWN[unit] ?? [unit, 1];
}

/** Return a number without the noise of a conversion. */
const exact = (value: number): number => Number(value.toPrecision(12));

/** Return the name of a setting without the stored unit at its end, since the field shows another one. */
export function nameWithoutUnit(name: string, { unit = "" }: Extra): string {
  return unit in SHOWN && name.endsWith(`_${unit}`) ? name.slice(0, -unit.length - 1) : name;
}

/** Return a description without the stored unit at its end, since the field shows another one. */
export function withoutUnit(description: string, type: string, extra: Extra): string {
  const { unit } = extra;
  if (!unit || shownUnit(type, extra)[0] === unit) return description;
  return description.replace(new RegExp(`,? \\[?${unit.replace("/", "\\/")}\\]?(?=[;.,]|$)`), "");
}

export type Source = "value" | "link" | "project_parameter" | "function_parameter";

/** Project parameters that the server maintains for scripts. */
export const OWN_PARAMETERS: ReadonlySet<string> = new Set(["scene_id", "project_id"]);

/** Types that a project parameter may have. */
export const SIMPLE = ["integer", "double", "boolean", "string"] as const;
export type Simple = (typeof SIMPLE)[number];

const TYPE_NAMES: Record<string, MessageDescriptor> = {
  integer: msg`whole number`,
  double: msg`number`,
  boolean: msg`yes or no`,
  string: msg`text`,
  string_enum: msg`choice`,
  integer_enum: msg`choice`,
  pose: msg`pose`,
  position: msg`position`,
  joints: msg`joints`,
  image: msg`picture`,
  relative_pose: msg`relative pose`,
};

/** Return the name of a parameter type as shown to users. */
export function typeName(type: string): string {
  const name = TYPE_NAMES[type];
  return name ? i18n._(name) : type;
}

export function extraOf(meta: Pick<ParameterMeta, "extra"> | undefined): Extra {
  if (!meta?.extra) return {};
  try {
    return (JSON.parse(meta.extra) as Extra | null) ?? {};
  } catch {
    return {};
  }
}

export function sourceOf(parameter: ActionParameter): Source {
  const { type } = parameter;
  return type === "link" || type === "project_parameter" || type === "function_parameter" ? type : "value";
}

/** Return a value as the text of a field. */
export function textOf(type: string, json: string | undefined, extra: Extra = {}): string {
  const value = decoded(json);
  if (value === undefined || value === null) return "";
  if (typeof value === "string") return value;
  if (typeof value === "boolean") return value ? t`yes` : t`no`;
  if (typeof value === "number") return decimal(exact(value * shownUnit(type, extra)[1]));
  return type.endsWith("pose") || typeof value === "object" ? JSON.stringify(value) : String(value);
}

type ParsedValue = { json: string } | { problem: string };

/** Read the text of a field: JSON for the server, or the problem as a sentence. */
export function parseValue(type: string, text: string, extra: Extra = {}): ParsedValue {
  const clean = text.trim();
  switch (type) {
    case "string":
      return { json: JSON.stringify(text) };
    case "boolean":
      return { json: ["yes", "true", "1", "on", t`yes`].includes(clean.toLowerCase()) ? "true" : "false" };
    case "integer":
    case "double":
      return readNumber(type, clean, extra);
    case "integer_enum":
      return { json: String(Number(clean)) };
    case "relative_pose":
      return decoded(clean) === undefined ? { problem: t`Enter a pose.` } : { json: clean };
    default:
      return clean ? { json: JSON.stringify(clean) } : { problem: t`Choose a value.` };
  }
}

function readNumber(type: "integer" | "double", text: string, extra: Extra): ParsedValue {
  const { minimum, maximum } = extra;
  const [, factor] = shownUnit(type, extra);
  const value = Number((numberFrom(text) / factor).toPrecision(15));
  if (!Number.isFinite(value)) return { problem: t`Enter a number.` };
  if (type === "integer" && !Number.isInteger(value))
    return { problem: factor === 1 ? t`Enter a whole number.` : t`Enter a multiple of ${decimal(factor)}.` };
  if (minimum !== undefined && value < minimum) return { problem: t`At least ${decimal(exact(minimum * factor))}.` };
  if (maximum !== undefined && value > maximum) return { problem: t`At most ${decimal(exact(maximum * factor))}.` };
  return { json: type === "double" ? doubleText(value) : String(value) };
}

/** On the wire a double has a fraction. */
export function doubleText(value: number): string {
  const text = String(value);
  return /[.e]/.test(text) ? text : `${text}.0`;
}

/** Return the initial value of a parameter of a simple type; undefined if there is none. */
export function initialValue(meta: ParameterMeta): string | undefined {
  if (meta.default_value !== undefined) return meta.default_value;
  const { minimum, maximum, allowed_values } = extraOf(meta);
  const least = Math.min(Math.max(0, minimum ?? 0), maximum ?? Infinity);
  switch (meta.type) {
    case "boolean":
      return "false";
    case "integer":
      return String(Math.ceil(least));
    case "double":
      return doubleText(least);
    case "string":
      return '""';
    case "string_enum":
    case "integer_enum":
      return allowed_values?.length ? JSON.stringify(allowed_values[0]) : undefined;
    default:
      return undefined;
  }
}

/** Return the range with its unit as text; an empty string without one. */
export function rangeWords(type: string, extra: Extra): string {
  const { minimum, maximum } = extra;
  const [unit, factor] = shownUnit(type, extra);
  const tail = unit ? ` ${unit}` : "";
  const shown = (value: number) => decimal(Number((value * factor).toPrecision(5)));
  if (minimum !== undefined && maximum !== undefined) return t`${shown(minimum)} to ${shown(maximum)}${tail}`;
  if (minimum !== undefined) return t`at least ${shown(minimum)}${tail}`;
  if (maximum !== undefined) return t`at most ${shown(maximum)}${tail}`;
  return "";
}
