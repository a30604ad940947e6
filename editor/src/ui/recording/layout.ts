/** The layout of a recording: signals, columns, and the visible time. Pure functions. */

import type { RecordedAction, Recording, Signal } from "../../commands/recordings";
import { translate } from "../../i18n/serverMessages";
import { shownUnit } from "../../program/values";

/** Number of points and of joints that are shown at first. */
const SHOWN_POINTS = 8;
const SHOWN_JOINTS = 6;
/** Time around the event in which a change is interesting, ms. */
const NEAR = 5000;
/** Time without a value after which a line stays level until shortly before the next one, ms. */
const HOLD = 250;
const RISE = 100;
/** Shortest visible time, ms. */
export const SHORTEST = 200;

export type Range = readonly [from: number, to: number];

/** A signal in the language and units of the user. */
export interface Trace {
  id: string;
  name: string;
  unit: string;
  digital: boolean;
  times: number[];
  values: (number | null)[];
}

export const idOf = ({ object_id, kind, name }: Signal): string => `${object_id}/${kind}/${name}`;
export const changes = ({ values }: Signal): boolean => values.length > 1;

/** Return a signal in the language and units of the user. `unit`: of a joint, rad or m. */
export function traceOf(signal: Signal, unit: string): Trace {
  const [shown, factor] = shownUnit("double", { unit: signal.kind === "joint" ? unit : signal.unit });
  const digital = isDigital(signal);
  const name = `${signal.object_name} · ${nameOf(signal)}`;
  const values = signal.values.map((value) => (value === null ? null : Number(value) * (digital ? 1 : factor)));
  return { id: idOf(signal), name, unit: digital ? "" : shown, digital, times: signal.times, values };
}

/** Return the name of a signal without its device. */
export function nameOf({ kind, name }: Signal): string {
  return kind === "joint" ? name : translate({ text: name });
}

/** Return whether a signal is on or off, which is drawn in steps. */
const isDigital = ({ values }: Signal): boolean => values.some((value) => typeof value === "boolean");

/** Return the ids of the signals that explain the event best: of its devices, then those that changed near it. */
export function shownAtFirst({ signals, alarms }: Recording): Set<string> {
  const devices = new Set(alarms.map((each) => each.object_id));
  const rank = (signal: Signal) =>
    devices.has(signal.object_id) ? 0 : signal.times.some((time) => Math.abs(time) < NEAR) ? 1 : 2;
  const found = signals.filter(changes).sort((a, b) => rank(a) - rank(b));
  const points = found.filter(({ kind }) => kind !== "joint").slice(0, SHOWN_POINTS);
  const joints = found.filter(({ kind }) => kind === "joint").slice(0, SHOWN_JOINTS);
  return new Set([...points, ...joints].map(idOf));
}

/** Return the traces by chart: digital ones together, others with the same unit, at most `most` in one. */
export function charts(traces: readonly Trace[], most: number): Trace[][] {
  const groups = new Map<string, Trace[]>();
  for (const trace of traces) {
    const key = trace.digital ? "digital" : `in ${trace.unit}`;
    groups.set(key, [...(groups.get(key) ?? []), trace]);
  }
  return [...groups.values()].flatMap((group) =>
    Array.from({ length: Math.ceil(group.length / most) }, (_, n) => group.slice(n * most, (n + 1) * most)),
  );
}

/** Return the index of the last value at or before a time; -1 before the first one. */
export function indexAt(times: readonly number[], time: number): number {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((times[middle] ?? 0) <= time) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

export function valueAt(trace: Trace, time: number): number | null {
  return trace.values[indexAt(trace.times, time)] ?? null;
}

/** Distance of digital traces in a chart. */
export const STEP = 1.5;

/**
 * Return the columns of a chart: times in s, then the values of each trace. Between its own values a line has
 * undefined, which is no gap. Digital traces are above each other, the first one on top.
 */
export function columns(traces: readonly Trace[], [begin, end]: Range): (number | null | undefined)[][] {
  const own = traces.map((trace) => (trace.digital ? stepsOf(trace) : lineOf(trace, [begin, end])));
  const times = [...new Set([begin, end, ...own.flatMap((each) => [...each.keys()])])]
    .filter((time) => time >= begin && time <= end)
    .sort((a, b) => a - b);
  const values = traces.map((trace, n) => {
    if (!trace.digital) return times.map((time) => own[n]?.get(time));
    const base = (traces.length - 1 - n) * STEP;
    return times.map((time) => {
      const value = valueAt(trace, time);
      return value === null ? null : value + base;
    });
  });
  return [times.map((time) => time / 1000), ...values];
}

function stepsOf(trace: Trace): Map<number, number | null> {
  return new Map(trace.times.map((time, n) => [time, trace.values[n] ?? null]));
}

function lineOf(trace: Trace, [begin, end]: Range): Map<number, number | null> {
  const points = new Map<number, number | null>();
  trace.times.forEach((time, n) => {
    const before = trace.times[n - 1];
    if (before !== undefined && time - before > HOLD) points.set(time - RISE, trace.values[n - 1] ?? null);
    points.set(time, trace.values[n] ?? null);
  });
  for (const edge of [begin, end]) if (!points.has(edge)) points.set(edge, valueAt(trace, edge));
  return points;
}

/** Return the visible time after zooming by a factor around a time. */
export function zoomed([from, to]: Range, factor: number, around: number, whole: Range): Range {
  const length = Math.min(Math.max((to - from) * factor, SHORTEST), whole[1] - whole[0]);
  const share = (around - from) / (to - from);
  return within([around - share * length, around + (1 - share) * length], whole);
}

/** Return the visible time moved by a time. */
export function moved([from, to]: Range, by: number, whole: Range): Range {
  return within([from + by, to + by], whole);
}

function within([from, to]: Range, [first, last]: Range): Range {
  const length = Math.min(to - from, last - first);
  const start = Math.min(Math.max(from, first), last - length);
  return [start, start + length];
}

/** An action in a row of its lane. */
interface Band {
  action: RecordedAction;
  row: number;
}

export interface Lane {
  /** Name of the device; empty for calls of functions. */
  name: string;
  bands: Band[];
  rows: number;
}

/** Return the actions by device, those that overlap in rows of their own. Calls of functions come first. */
export function lanes(actions: readonly RecordedAction[], end: number): Lane[] {
  const found = new Map<string, Lane & { ends: number[] }>();
  for (const action of [...actions].sort((a, b) => a.begin - b.begin || a.number - b.number)) {
    const name = action.object_name ?? "";
    const lane = found.get(name) ?? { name, bands: [], rows: 0, ends: [] };
    found.set(name, lane);
    const free = lane.ends.findIndex((each) => each <= action.begin);
    const row = free < 0 ? lane.ends.length : free;
    lane.ends[row] = action.end ?? end;
    lane.rows = lane.ends.length;
    lane.bands.push({ action, row });
  }
  return [...found.values()]
    .sort((a, b) => Number(a.name !== "") - Number(b.name !== ""))
    .map(({ name, bands, rows }) => ({ name, bands, rows }));
}

/** Return the actions that were running at a time. */
export function runningAt(actions: readonly RecordedAction[], time: number): RecordedAction[] {
  return actions.filter((each) => each.begin <= time && (each.end === undefined || each.end > time));
}
