/** Completions in the text editor: names, actions, points, signatures. Pure functions. */

import { t } from "@lingui/core/macro";
import { decoded } from "../../program/json";
import { CALL, metaOf } from "../../program/logic";
import { freeName } from "../../program/naming";
import { typeName } from "../../program/values";
import type { ObjectAction, ParameterMeta } from "../../protocol/types";
import type { OpenDocument, State } from "../../store/state";

export interface Offer {
  label: string;
  /** Kind of the icon. */
  type: "variable" | "method" | "property" | "constant";
  /** Short text next to it. */
  detail: string;
  info?: string;
  /** The inserted text, with fields as `${name}`. */
  snippet?: string;
  /** Whether it has the type of the parameter at the cursor. */
  fits?: boolean;
}

interface Offers {
  /** Where the replaced word starts. */
  from: number;
  offers: Offer[];
}

export interface Signature {
  /** Position of the opening bracket. */
  at: number;
  object: string;
  action: ObjectAction;
  /** Index of the parameter at the cursor. */
  active: number;
}

const KEYWORDS: ReadonlySet<string> = new Set(
  [
    "False None True and as assert async await break class continue def del elif else except finally for from global",
    "if import in is lambda nonlocal not or pass raise return try while with yield",
  ].flatMap((each) => each.split(" ")),
);

/** Return a name as the generated script writes it. */
export function identifier(text: string): string {
  let name = text.replace(/[^A-Za-z0-9_]/g, "_");
  if (name.startsWith("__")) name = name.replace(/^_+/, "_");
  if (!name || /^\d/.test(name)) name = `_${name}`;
  return KEYWORDS.has(name) ? `${name}_` : name;
}

/** Return the names of items as attributes, unique in their order. */
function attributes(names: readonly string[]): string[] {
  const found: string[] = [];
  for (const name of names) {
    const wanted = identifier(name);
    const stem = wanted.endsWith("_") ? wanted : `${wanted}_`;
    let free = wanted;
    for (let number = 2; found.includes(free); number++) free = `${stem}${number}`;
    found.push(free);
  }
  return found;
}

/** Return the ids of the objects by their variables. */
function objectsIn(source: string): Map<string, string> {
  const found = source.matchAll(/^ +(\w+)(?:: *[\w.]+)? = res\.objects\["([^"\n]*)"\]/gm);
  return new Map([...found].map((each) => [each[1] ?? "", each[2] ?? ""]));
}

const actionsOf = (doc: OpenDocument, types: State["types"], objectId: string): ObjectAction[] =>
  (types.actions[doc.objects[objectId]?.type ?? ""] ?? []).filter((each) => !each.disabled && !each.meta.hidden);

/** Return the description of `object.method`, or of the function with a name. */
function described(
  objects: Map<string, string>,
  doc: OpenDocument,
  types: State["types"],
  object: string,
  method: string,
): ObjectAction | undefined {
  const called = object ? undefined : Object.values(doc.functions).find((each) => identifier(each.name) === method);
  const found = metaOf(types, doc, { type: called ? `${called.id}/${CALL}` : `${objects.get(object)}/${method}` });
  return called && found ? { ...found, name: method } : found;
}

/** A variable that is assigned on all paths to a line. */
interface Variable {
  name: string;
  /** Type of its value; "error" for the error of an action; empty if unknown. */
  type: string;
}

const indentOf = (line: string): number => line.length - line.trimStart().length;

/** Return the variables in scope: assigned above in a block that is still open. */
function variables(source: string, at: number, doc: OpenDocument, types: State["types"]): Variable[] {
  const objects = objectsIn(source);
  const above = source.slice(0, at).split("\n");
  const found = new Map<string, Variable>();
  let open = indentOf(above.pop() ?? "") || 4;
  for (const line of above.reverse()) {
    if (!line.trim()) continue;
    const indent = indentOf(line);
    if (indent > open) continue;
    open = indent;
    if (indent === 0) break;
    const assigned = /^\s*(\w+(?:, *\w+)*) = (?:(?:(\w+)\.)?(\w+)\(|(.*))/.exec(line);
    if (!assigned) continue;
    const [, names = "", object = "", method = ""] = assigned;
    const action = described(objects, doc, types, object, method);
    names.split(/, */).forEach((name, n) => {
      const parameter = Object.values(doc.parameters).find((each) => each.name === name);
      const type = object === "res" && method === "caught" ? "error" : (action?.returns[n] ?? parameter?.type ?? "");
      if (!found.has(name) && name !== "aps") found.set(name, { name, type });
    });
  }
  return [...found.values()];
}

/** Return a default value as Python. */
function literal(parameter: ParameterMeta): string | undefined {
  const value = decoded(parameter.default_value);
  if (value === undefined || value === null || parameter.type.endsWith("_enum")) return undefined;
  if (typeof value === "boolean") return value ? "True" : "False";
  if (typeof value === "number" && parameter.type === "double" && Number.isInteger(value)) return value.toFixed(1);
  return typeof value === "object" ? undefined : JSON.stringify(value);
}

/** Return a parameter with its type and default value: "approach: number = 0.08". */
export function parameterWords(parameter: ParameterMeta): string {
  const value = literal(parameter);
  return `${parameter.name}: ${typeName(parameter.type)}${value === undefined ? "" : ` = ${value}`}`;
}

export const resultWords = ({ returns }: ObjectAction): string =>
  returns.length === 0 ? "" : ` → ${returns.map(typeName).join(", ")}`;

function callOf(source: string, action: ObjectAction): Offer {
  const fields = action.parameters.map((each) => `\${${literal(each) ?? each.name}}`);
  const taken = [...source.matchAll(/\ban="([^"\n]*)"/g)].map((each) => each[1] ?? "");
  return {
    label: action.name,
    type: "method",
    detail: `(${action.parameters.map((each) => each.name).join(", ")})${resultWords(action)}`,
    ...(action.description && { info: action.description }),
    snippet: `${action.name}(${[...fields, `an="\${${freeName(action.name, taken)}}"`].join(", ")})`,
  };
}

/** Return the poses, positions and joints of the action points as expressions. */
function places(doc: OpenDocument, type: string, robot: string): Offer[] {
  const points = Object.values(doc.points);
  const names = attributes(points.map((each) => each.name));
  return points.flatMap((point, n): Offer[] => {
    const items =
      type === "pose"
        ? Object.values(doc.orientations)
        : Object.values(doc.joints).filter((each) => !robot || each.robot_id === robot);
    if (type === "position") return [expression(`aps.${names[n]}.position`, type)];
    const own = items.filter((each) => each.pointId === point.id);
    const group = type === "pose" ? "poses" : "joints";
    return attributes(own.map((each) => each.name)).map((name) => expression(`aps.${names[n]}.${group}.${name}`, type));
  });
}

const expression = (label: string, type: string): Offer => ({
  label,
  type: "constant",
  detail: typeName(type),
  fits: true,
});

/** Return the completions at a position; null if there are none. */
export function offersAt(source: string, at: number, doc: OpenDocument, types: State["types"]): Offers | null {
  const line = source.slice(source.lastIndexOf("\n", at - 1) + 1, at);
  if (/^[^"'#]*#/.test(line) || inString(line)) return null;
  const path = /(?:[A-Za-z_]\w*\.)*\w*$/.exec(line)?.[0] ?? "";
  const parts = path.split(".");
  const word = parts.pop() ?? "";
  const from = at - word.length;
  if (parts.length > 0) {
    const offers = members(source, from, parts, doc, types);
    return offers.length > 0 ? { from, offers } : null;
  }
  if (/^\d/.test(word) || /\b(?:import|from|def|class)\s+[\w.]*$/.test(line)) return null;
  const signature = signatureAt(source, at, doc, types);
  const wanted = signature?.action.parameters[signature.active];
  const offers: Offer[] = [];
  if (wanted) {
    const robot = objectsIn(source).get(signature.object) ?? "";
    if (wanted.type === "pose" || wanted.type === "position" || wanted.type === "joints")
      offers.push(...places(doc, wanted.type, robot));
    if (wanted.type === "boolean") offers.push(...["True", "False"].map((each) => expression(each, "boolean")));
  }
  for (const { name, type } of variables(source, at, doc, types)) {
    if (objectsIn(source).has(name)) continue;
    const detail = type === "error" ? t`error of an action` : type && typeName(type);
    offers.push({ label: name, type: "variable", detail, fits: type !== "" && type === wanted?.type });
  }
  for (const [name, id] of objectsIn(source)) {
    const { type = "" } = doc.objects[id] ?? {};
    if (actionsOf(doc, types, id).length > 0)
      offers.push({ label: name, type: "variable", detail: types.byName[type]?.display_name ?? type });
  }
  for (const { name } of Object.values(doc.functions)) {
    const action = described(objectsIn(source), doc, types, "", identifier(name));
    if (action) offers.push(callOf(source, action));
  }
  offers.push({ label: "aps", type: "variable", detail: t`action points` });
  return { from, offers };
}

const inString = (line: string): boolean =>
  (line.replace(/\\./g, "").match(/"/g) ?? []).length % 2 === 1 ||
  (line.replace(/\\.|"[^"]*"/g, "").match(/'/g) ?? []).length % 2 === 1;

/** Return the completions after a path such as `robot.` or `aps.feeder.poses.`. */
function members(source: string, at: number, path: string[], doc: OpenDocument, types: State["types"]): Offer[] {
  const [first = "", name = "", group = "", ...deeper] = path;
  const property = (label: string, detail = ""): Offer => ({ label, type: "property", detail });
  if (first !== "aps") {
    if (name) return [];
    const object = objectsIn(source).get(first);
    if (object !== undefined) return actionsOf(doc, types, object).map((each) => callOf(source, each));
    const variable = variables(source, at, doc, types).find((each) => each.name === first);
    return variable?.type === "error"
      ? ["device", "kind", "text"].map((each) => property(each, typeName("string")))
      : [];
  }
  const points = Object.values(doc.points);
  const names = attributes(points.map((each) => each.name));
  if (!name) return names.map((each) => property(each, t`action point`));
  const point = points[names.indexOf(name)];
  if (!point || deeper.length > 0) return [];
  if (!group) return ["position", "poses", "joints"].map((each) => property(each));
  const items = group === "poses" ? doc.orientations : group === "joints" ? doc.joints : {};
  const own = Object.values(items).filter((each) => each.pointId === point.id);
  return attributes(own.map((each) => each.name)).map((each) =>
    property(each, typeName(group === "poses" ? "pose" : group)),
  );
}

/** Return the call of an action that contains a position; null if there is none. */
export function signatureAt(source: string, at: number, doc: OpenDocument, types: State["types"]): Signature | null {
  const line = source.lastIndexOf("\n", at - 1) + 1;
  // A call may be spread over lines; strings have no brackets or commas from here on.
  const start = Math.max(0, source.lastIndexOf("\n\n", line));
  const text = source
    .slice(start, at)
    .replace(/"(?:[^"\\\n]|\\.)*"?|'(?:[^'\\\n]|\\.)*'?/g, (each) => "_".repeat(each.length));
  let [depth, commas] = [0, 0];
  let last = text.length;
  for (let n = text.length - 1; n >= 0; n--) {
    const character = text[n] ?? "";
    if (")]}".includes(character)) depth++;
    else if (character === "," && depth === 0) {
      if (commas++ === 0) last = n + 1;
    } else if ("([{".includes(character) && depth-- === 0) {
      const called = /(?:(\w+)\.)?(\w+)$/.exec(text.slice(0, n));
      const [, object = "", method = ""] = called ?? [];
      const action = described(objectsIn(source), doc, types, object, method);
      if (!action || character !== "(") return null;
      const keyword = /^\s*(\w+)\s*=/.exec(text.slice(commas === 0 ? n + 1 : last))?.[1];
      const active = keyword === undefined ? commas : action.parameters.findIndex((each) => each.name === keyword);
      return { at: start + n, object, action, active };
    }
  }
  return null;
}
