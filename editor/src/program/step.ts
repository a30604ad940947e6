/** The running action in words: its description, its parameters, and its usual duration. Pure functions. */

import { t } from "@lingui/core/macro";
import type { Action, ActionParameter, TraceEntry } from "../protocol/types";
import { anyAction } from "../store/scope";
import type { OnPoint, OpenDocument, State } from "../store/state";
import { errorAt } from "./errorExits";
import { decoded } from "./json";
import { calledBy, metaOf, PASSED_ON } from "./logic";
import { words } from "./naming";
import { innermost, pathWords } from "./position";
import { type Extra, extraOf, shownUnit, textOf } from "./values";

/** Largest number of shown parameters. */
const SHOWN = 3;
/** An action takes unusually long after this multiple of its usual duration and this additional time, s. */
const LONG = 2;
const GRACE = 3;

/** The action that runs, or before which the program is paused. */
export interface Step {
  id: string;
  name: string;
  /** Name of its device. */
  device: string;
  /** The description of the action by its object type; empty if unknown. */
  does: string;
  /** Its most important parameters as text; empty if it has none. */
  values: string;
  /** When it was announced, ms since 1970; undefined if unknown. */
  started: number | undefined;
  /** Mean of its earlier durations, s; undefined the first time. */
  usual: number | undefined;
}

/** Return the steps that run now; several if the program has threads. */
export function stepsOf(state: State): Step[] {
  const { doc, types, program } = state;
  if (!doc) return [];
  return innermost(state).flatMap((id) => {
    const action = anyAction(doc, id);
    if (!action) return [];
    const calls = program.trace.filter((each) => each.action_id === id);
    return [
      {
        id,
        name: pathWords(state, id),
        device: doc.objects[action.type.split("/")[0] ?? ""]?.name ?? calledBy(doc, action)?.name ?? "",
        does: firstSentence(metaOf(types, doc, action)?.description),
        values: valuesOf(doc, types, action, isOpen(calls.at(-1)) ? calls.at(-1)?.parameters : []),
        started: startOf(calls),
        usual: meanDuration(calls),
      },
    ];
  });
}

/** Return whether a step takes unusually long at a time, ms since 1970. */
export function isLate({ started, usual }: Step, time: number): boolean {
  return started !== undefined && usual !== undefined && (time - started) / 1000 > LONG * usual + GRACE;
}

function startOf(calls: readonly TraceEntry[]): number | undefined {
  const last = calls.at(-1);
  return isOpen(last) ? Date.parse(last.started) : undefined;
}

/** Return whether a call has not ended. */
const isOpen = (call: TraceEntry | undefined): call is TraceEntry =>
  call !== undefined && call.duration === undefined && call.error === undefined;

function meanDuration(calls: readonly TraceEntry[]): number | undefined {
  const durations = calls.flatMap(({ duration, error }) =>
    duration === undefined || error !== undefined ? [] : [duration],
  );
  return durations.length === 0 ? undefined : durations.reduce((sum, each) => sum + each, 0) / durations.length;
}

/** Return the first sentence of a description, up to its details. */
function firstSentence(description = ""): string {
  return (/^[^.;\n]+/.exec(description.trim())?.[0] ?? "").trim();
}

/**
 * Return the first values that the name and the point of an action do not already contain, with their units.
 *
 * `sent`: the values that the running action has received, in the order of its parameters; then results and variables
 * are shown by their values, not by their names, and left out while these are unknown.
 */
export function valuesOf(
  doc: OpenDocument,
  types: State["types"],
  action: OnPoint<Action>,
  sent?: readonly string[],
): string {
  const parameters = metaOf(types, doc, action)?.parameters ?? [];
  return action.parameters
    .flatMap((parameter) => {
      const index = parameters.findIndex((each) => each.name === parameter.name);
      const wanted = parameters[index];
      const value = sent?.[index];
      const varies = ["link", PASSED_ON].includes(parameter.type);
      if (sent && varies && (value === undefined || !wanted)) return [];
      const shown = varies && value !== undefined && wanted ? { name: "", type: wanted.type, value } : parameter;
      const text = shortValue(doc, action, shown, extraOf(wanted));
      return text ? [`${words(parameter.name)} ${text}`] : [];
    })
    .slice(0, SHOWN)
    .join(" · ");
}

function shortValue(
  doc: OpenDocument,
  action: OnPoint<Action>,
  { type, value }: ActionParameter,
  extra: Extra,
): string {
  const read = decoded(value);
  if (type === "project_parameter") {
    const parameter = doc.parameters[String(read)];
    if (!parameter) return "";
    return parameter.variable ? parameter.name : shortValue(doc, action, parameter, extra);
  }
  if (type === "link") {
    const part = errorAt(doc, String(read));
    if (part) return t`${part.name} of ${part.action.name}`;
    const [from = "", , index] = String(read).split("/");
    const source = doc.actions[from]?.flows.find((flow) => flow.type === "default");
    return source?.outputs?.[Number(index)] ?? "";
  }
  const at = doc.orientations[String(read)] ?? doc.joints[String(read)];
  if (at) return at.pointId === action.pointId ? "" : (doc.points[at.pointId]?.name ?? "");
  const text = typeof read === "object" || type === "pose" ? "" : textOf(type, value, extra);
  const [unit] = shownUnit(type, extra);
  return text && unit ? `${text}\u00a0${unit}` : text;
}
