/** The observations of a device over the last minutes, as columns for charts. Pure functions. */

import { translate } from "../../i18n/serverMessages";
import { shownUnit } from "../../program/values";
import type { ObjectObservationsData, Observation } from "../../protocol/types";

/** Length of the history, s. */
export const SPAN = 300;
/** Rate of the observations, Hz. */
export const RATE = 2;
/** Time without observations that is drawn as a gap, s. */
const GAP = 3 / RATE;

export interface Series {
  /** Name as the device reports it. */
  id: string;
  /** Name and unit in the language and units of the user. */
  name: string;
  unit: string;
  binary: boolean;
  /** One value for each time; null if the quality was bad or no value was known. */
  values: (number | null)[];
  /** The newest observation, to be shown as text. */
  last: Observation;
}

export interface History {
  /** s since 1970, ascending. */
  times: number[];
  series: Series[];
  /** The reason why there is no new value; empty if there is one. */
  failure: string;
}

export const NO_HISTORY: History = { times: [], series: [], failure: "" };

/** Return the history with the observations of a time, s since 1970, without what is older than SPAN. */
export function withObservations(
  history: History,
  { observations, reason = "" }: Pick<ObjectObservationsData, "observations" | "reason">,
  time: number,
): History {
  const before = history.times.at(-1);
  const paused = before !== undefined && time - before > GAP;
  // The row of a gap: a line would connect the values before and after it.
  const added = paused ? [before + GAP / 2, time] : [time];
  const times = [...history.times, ...added];
  const first = times.findIndex((each) => each >= time - SPAN);
  const known = new Map(history.series.map((each) => [each.id, each]));
  for (const each of observations)
    if (!known.has(each.name)) known.set(each.name, newSeries(each, history.times.length));
  const series = [...known.values()].map((each) => {
    const found = observations.find(({ name }) => name === each.id);
    const value = found ? shownValue(found) : null;
    const values = [...each.values, ...(paused ? [null] : []), value].slice(first);
    return { ...each, values, last: found ?? { ...each.last, value: null, quality: "bad" as const } };
  });
  return { times: times.slice(first), series, failure: reason };
}

function newSeries(observation: Observation, length: number): Series {
  const { name, unit, value } = observation;
  return {
    id: name,
    name: translate({ text: name }),
    unit: shownUnit("double", { unit })[0],
    binary: typeof value === "boolean",
    values: Array<null>(length).fill(null),
    last: observation,
  };
}

/** Return the value in the unit of the user; null if it is not known. */
export function shownValue({ value, unit, quality }: Observation): number | null {
  if (value === null || quality === "bad") return null;
  return typeof value === "boolean" ? Number(value) : value * shownUnit("double", { unit })[1];
}

/** Return the series that share a chart: those with the same unit, at most `most` in one. */
export function charts(series: readonly Series[], most: number): Series[][] {
  const groups = new Map<string, Series[]>();
  for (const each of series) {
    const key = each.binary ? "binary" : each.unit;
    groups.set(key, [...(groups.get(key) ?? []), each]);
  }
  return [...groups.values()].flatMap((group) =>
    Array.from({ length: Math.ceil(group.length / most) }, (_, n) => group.slice(n * most, (n + 1) * most)),
  );
}
