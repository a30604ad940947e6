/** Geometry of a Gantt chart. Bars that would be narrower than a pixel are joined, so that long runs stay fast. */

import type { Span } from "../../protocol/types";

/** Smallest width of a bar, and largest gap that is not drawn, pixels. */
const PIXEL = 1;

export interface Bar {
  x: number;
  width: number;
  failed: boolean;
  /** The only action of the bar; undefined for several. */
  span?: Span;
}

/** Return the row of an action: its device, or the branch of parallel work that executes it; empty for none. */
export type RowOf = (span: Span) => string;

export const byDevice: RowOf = ({ device }) => device;
/** The calls of the branches themselves are not shown, only their actions. */
export const byLane: RowOf = ({ device, lane }) => (device === "" ? "" : (lane ?? ""));

/** Return the branches of parallel work in a trace, with the names of their calls, in the order of their start. */
export const lanesIn = (spans: readonly Span[]): Map<string, string> =>
  new Map(spans.filter(({ action_id, lane }) => action_id === lane).map(({ action_id, name }) => [action_id, name]));

/** Return the bars of each row between two times, s. `scale` is in pixels per s; x is relative to the time 0. */
export function bars(
  spans: readonly Span[],
  from: number,
  to: number,
  scale: number,
  rowOf: RowOf = byDevice,
): Map<string, Bar[]> {
  const found = new Map<string, Bar[]>();
  for (const span of spans) {
    const end = span.start + span.duration;
    if (end < from || span.start > to) continue;
    const key = rowOf(span);
    const row = found.get(key) ?? [];
    found.set(key, row);
    const x = span.start * scale;
    const width = Math.max(PIXEL, span.duration * scale);
    const failed = span.error !== undefined;
    const last = row.at(-1);
    const tiny = width <= 2 * PIXEL && last && (last.span === undefined || last.width <= 2 * PIXEL);
    if (tiny && x - last.x - last.width < PIXEL && failed === last.failed) {
      last.width = Math.max(last.width, x + width - last.x);
      delete last.span;
    } else row.push({ x, width, failed, span });
  }
  return found;
}

/** Return times of marks, s, at round numbers and at least `space` pixels apart. */
export function ticks(from: number, to: number, scale: number, space: number): number[] {
  const least = space / scale;
  const power = 10 ** Math.floor(Math.log10(least));
  const step = [1, 2, 5, 10].map((each) => each * power).find((each) => each >= least) ?? 10 * power;
  const first = Math.ceil(from / step - 1e-9);
  return Array.from({ length: Math.max(0, Math.floor(to / step + 1e-9) - first + 1) }, (_, n) => (first + n) * step);
}

/** Return the action of a row nearest to a time, at most `within` s away. */
export function nearest(
  spans: readonly Span[],
  row: string,
  time: number,
  within: number,
  rowOf: RowOf = byDevice,
): Span | undefined {
  let best: Span | undefined;
  let least = within;
  for (const span of spans) {
    if (rowOf(span) !== row) continue;
    const away = Math.max(span.start - time, time - span.start - span.duration, 0);
    if (away > least || (best && away === least)) continue;
    best = span;
    least = away;
    if (away === 0) break;
  }
  return best;
}
