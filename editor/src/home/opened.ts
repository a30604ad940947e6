/** Documents that a user opened recently. Pure functions. */

export type Opened = readonly string[];

/** Number of remembered documents. */
const MOST = 50;
const PREFIX = "opened/";

/** Return ids from stored values, `opened/<id>` with the time in ms; newest first. */
export function openedOf(values: Record<string, unknown>): Opened {
  return Object.entries(values)
    .flatMap(([key, time]) =>
      key.startsWith(PREFIX) && typeof time === "number" ? [{ id: key.slice(PREFIX.length), time }] : [],
    )
    .sort((a, b) => b.time - a.time)
    .map(({ id }) => id);
}

/** Return the documents to forget when `id` is opened. */
export function toForget(opened: Opened, id: string): Opened {
  return opened.filter((each) => each !== id).slice(MOST - 1);
}
