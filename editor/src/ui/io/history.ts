/** The history of a point as its chart shows it. Pure functions. */

import type { PointSummary } from "../../commands/history";

const HOUR = 3_600_000;
/** The periods that can be shown, ms. */
export const SPANS = { hour: HOUR, day: 24 * HOUR, week: 7 * 24 * HOUR } as const;
export type Span = keyof typeof SPANS;
/** Number of equal parts of a period. */
export const BUCKETS = 300;

const MIN_PAUSE = 5000;
const MAX_PAUSE = 60_000;

/** Return the time between two readings of a period that ends now, ms: half of its parts, within limits. */
export function pauseOf(span: Span): number {
  return Math.min(Math.max(SPANS[span] / BUCKETS / 2, MIN_PAUSE), MAX_PAUSE);
}

type Column = (number | null)[];

/** Return times in s, and the mean, lowest and highest value times `factor`, with gaps at unknown values. */
export function columnsOf(
  { since, until, times, mean, lowest, highest }: PointSummary,
  factor: number,
): [number[], Column, Column, Column] {
  const width = Math.max(1, Math.ceil((until - since) / BUCKETS));
  const seconds: number[] = [];
  const columns: [Column, Column, Column] = [[], [], []];
  const add = (time: number, values: Column) => {
    seconds.push(time / 1000);
    columns.forEach((column, n) => {
      const value = values[n] ?? null;
      column.push(value === null ? null : value * factor);
    });
  };
  times.forEach((time, n) => {
    const before = times[n - 1];
    if (before !== undefined && time - before > width) add(before + width, []);
    add(time, [mean[n] ?? null, lowest[n] ?? null, highest[n] ?? null]);
  });
  return [seconds, ...columns];
}

/** Return the indices of values without a known neighbour: no line leads to them. */
export function aloneIn(column: ArrayLike<number | null | undefined>): number[] {
  const known = (n: number) => (column[n] ?? null) !== null;
  return Array.from(column, (_, n) => n).filter((n) => known(n) && !known(n - 1) && !known(n + 1));
}

/** Return the lowest, the mean and the highest value of the whole period; null if nothing is known. */
export function overall({ mean, lowest, highest }: PointSummary): [number, number, number] | null {
  if (mean.length === 0) return null;
  return [Math.min(...lowest), mean.reduce((sum, each) => sum + each, 0) / mean.length, Math.max(...highest)];
}
