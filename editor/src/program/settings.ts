/** Settings of devices: missing values and groups. Pure functions. */

import type { ObjectTypeMeta, Parameter, ParameterMeta } from "../protocol/types";
import type { OpenDocument, State } from "../store/state";

/** JSON of each setting that differs from its default. */
export type Values = Record<string, string>;

/** Return the values in the format of the server. */
export function parametersOf(settings: ParameterMeta[], values: Values): Parameter[] {
  return settings.flatMap(({ name, type }) =>
    values[name] === undefined ? [] : [{ name, type, value: values[name] }],
  );
}

/** Return the values of a stored object. */
export const valuesOf = (parameters: Parameter[]): Values =>
  Object.fromEntries(parameters.map((each) => [each.name, each.value]));

const isEmpty = (value: string | undefined) => value === undefined || value === '""';

/** Return the names of the settings that a device cannot be created without, and that have no value. */
export function missing(settings: ParameterMeta[], values: Values): string[] {
  return settings
    .filter(({ name, default_value }) => default_value === undefined && isEmpty(values[name]))
    .map(({ name }) => name);
}

/** Return the names of the settings that a device cannot be controlled without, and that are not set. */
export function missingForControl(settings: ParameterMeta[], values: Values): string[] {
  return settings
    .filter(({ name, for_control, default_value }) => for_control && (values[name] ?? default_value) === default_value)
    .map(({ name }) => name);
}

/** A device that is online but cannot be controlled. */
export interface Uncontrolled {
  id: string;
  name: string;
  /** Names of the settings that are not set. */
  settings: string[];
}

/** Return the devices that cannot be controlled because of their settings. The project and the server override some. */
export function uncontrolled(
  doc: OpenDocument | null,
  types: Record<string, ObjectTypeMeta>,
  states: State["live"]["objects"],
): Uncontrolled[] {
  return Object.values(doc?.objects ?? {}).flatMap(({ id, name, type, parameters }) => {
    const here = new Set([...Object.keys(doc?.overrides[id] ?? {}), ...(states[id]?.overlaid ?? [])]);
    const settings = missingForControl(types[type]?.settings ?? [], valuesOf(parameters)).filter(
      (each) => !here.has(each),
    );
    return settings.length > 0 ? [{ id, name, settings }] : [];
  });
}

/** Settings with a common first word, such as tcp_x and tcp_y; without one they have an empty title. */
export interface Group {
  title: string;
  settings: ParameterMeta[];
}

/** Number of settings with a common first word from which they are a group. */
const GROUPED = 3;

export function grouped(settings: ParameterMeta[]): Group[] {
  const first = ({ name }: ParameterMeta) => name.split("_")[0] ?? "";
  const count = new Map<string, number>();
  for (const each of settings) count.set(first(each), (count.get(first(each)) ?? 0) + 1);
  const titleOf = (each: ParameterMeta) => ((count.get(first(each)) ?? 0) >= GROUPED ? first(each) : "");
  const titles = [...new Set(settings.map(titleOf))].sort((a, b) => Number(a === "") - Number(b === ""));
  return titles.map((title) => ({ title, settings: settings.filter((each) => titleOf(each) === title) }));
}
