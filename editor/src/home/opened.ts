/** Documents that a user opened recently. Pure functions. */

export type RecentIds = readonly string[];

/** Number of remembered documents. */
const MOST = 50;
const PREFIX = "opened/";

/** Return ids from stored values, `opened/<id>` with the time in ms; newest first. */
export function recentIds(values: Record<string, unknown>): RecentIds {
  return Object.entries(values)
    .flatMap(([key, time]) =>
      key.startsWith(PREFIX) && typeof time === "number" ? [{ id: key.slice(PREFIX.length), time }] : [],
    )
    .sort((a, b) => b.time - a.time)
    .map(({ id }) => id);
}

/** Return the documents to forget when `id` is opened. */
export function idsToForget(opened: RecentIds, id: string): RecentIds {
  return opened.filter((each) => each !== id).slice(MOST - 1);
}
