/** Results that the server of the fleet has stored: requests, periods, and counts per cell. */

import { t } from "@lingui/core/macro";
import { saveAs } from "../commands/files";
import { compareTexts } from "../formats";
import type { FleetAlarm, FleetCause, FleetCount, FleetProduction, FleetUnit, UnitRecord } from "../protocol/types";
import { FILE_DEADLINE, rest } from "../session/rest";

const HOUR = 3600;
/** Number of entries in a page of a list. */
export const PAGE = 50;

/** The last 8 hours, 24 hours or 7 days, or a chosen day. */
export type Span = "8" | "24" | "168" | "day";

/** Which results are shown. `day` is YYYY-MM-DD, in the time zone of this device; `cell` is empty for all cells. */
export interface Choice {
  span: Span;
  day: string;
  cell: string;
}

/** A period, s since 1970. */
export interface Period {
  since: number;
  until: number;
}

/** Return the period of a choice at a time, ms since 1970. A day may have 23 or 25 hours. */
export function periodOf({ span, day }: Choice, present: number): Period {
  if (span !== "day") {
    const until = Math.floor(present / 1000) + 1;
    return { since: until - Number(span) * HOUR, until };
  }
  const [year = 0, month = 1, date = 1] = day.split("-").map(Number);
  const seconds = (each: Date) => Math.floor(each.getTime() / 1000);
  return { since: seconds(new Date(year, month - 1, date)), until: seconds(new Date(year, month - 1, date + 1)) };
}

/** Return a day as YYYY-MM-DD, in the time zone of this device. */
export function dayOf(present: number): string {
  const date = new Date(present);
  const two = (value: number) => String(value).padStart(2, "0");
  return `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())}`;
}

export type Query = Readonly<Record<string, string | number>>;

async function load<Data>(path: string, query: Query): Promise<Data> {
  const words = new URLSearchParams(Object.entries(query).map(([key, value]) => [key, String(value)]));
  return (await rest(`/api/fleet/${path}?${words}`)).json();
}

/** Return the position of an entry, after which the next page begins; empty for the first page. */
const placeOf = (last?: { at: number; id: number }) => (last ? `${last.at}-${last.id}` : "");

export const loadProduction = (query: Query) => load<FleetProduction>("production", query);
export const loadCauses = (query: Query) => load<FleetCause[]>("causes", query);
export const loadUnits = (query: Query, last?: FleetUnit) =>
  load<FleetUnit[]>("units", { ...query, limit: PAGE, before: placeOf(last) });
export const loadAlarms = (query: Query, last?: FleetAlarm) =>
  load<FleetAlarm[]>("alarms", { ...query, limit: PAGE, before: placeOf(last) });
export const loadUnit = (id: number) => load<UnitRecord>(`units/${id}`, {});

/** Save units or alarms as CSV on this device. Reject with a sentence. */
export async function exportResults(file: "units" | "alarms", query: Query): Promise<void> {
  const words = new URLSearchParams(Object.entries(query).map(([key, value]) => [key, String(value)]));
  const failure = t`The records are not available`;
  const response = await rest(`/api/fleet/${file}/export?${words}`, { failure, deadline: FILE_DEADLINE });
  saveAs(await response.blob(), `${file}-${new Date().toISOString().slice(0, 10)}.csv`);
}

export type Counts = Pick<FleetCount, "good" | "bad" | "rejected">;

/** Units of a cell, and of each of its products and programs if there are several. */
interface CellCounts extends Counts {
  cell: string;
  parts: FleetCount[];
}

/** Return the sum of counts. */
export function sumOf(counts: readonly Counts[]): Counts {
  const sum = { good: 0, bad: 0, rejected: 0 };
  for (const each of counts) {
    sum.good += each.good;
    sum.bad += each.bad;
    sum.rejected += each.rejected;
  }
  return sum;
}

/** Return the share of good units, 0 to 1; undefined without units. */
export function yieldOf({ good, bad, rejected }: Counts): number | undefined {
  const all = good + bad + rejected;
  return all > 0 ? good / all : undefined;
}

/** Return counts by cell, sorted by name. */
export function byCell(counts: readonly FleetCount[]): CellCounts[] {
  const cells = new Map<string, FleetCount[]>();
  for (const each of counts) {
    if (each.good + each.bad + each.rejected === 0) continue;
    const known = cells.get(each.cell);
    if (known) known.push(each);
    else cells.set(each.cell, [each]);
  }
  const named = (part: FleetCount) => `${part.product} ${part.program}`;
  return [...cells]
    .map(([cell, parts]) => ({
      cell,
      ...sumOf(parts),
      parts: parts.sort((one, other) => compareTexts(named(one), named(other))),
    }))
    .sort((one, other) => compareTexts(one.cell, other.cell));
}
