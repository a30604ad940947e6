/** What a user has opened last: pure. */

export type Opened = readonly string[];

/** So many are remembered. */
const MOST = 50;
const PREFIX = "opened/";

/** Ids from the values that are kept of a user, `opened/<id>` with the time in ms; the last opened first. */
export function openedOf(values: Record<string, unknown>): Opened {
  return Object.entries(values)
    .flatMap(([key, time]) =>
      key.startsWith(PREFIX) && typeof time === "number" ? [{ id: key.slice(PREFIX.length), time }] : [],
    )
    .sort((a, b) => b.time - a.time)
    .map(({ id }) => id);
}

/** Those that are to be forgotten when `id` is opened. */
export function beyond(opened: Opened, id: string): Opened {
  return opened.filter((each) => each !== id).slice(MOST - 1);
}
