/** Filter and order of the search. */

export interface Entry {
  id: string;
  words: string;
  /** Kind or state of the entry. */
  detail: string;
  /** The reason why it is not available; empty if it is available. */
  why: string;
  act: () => void;
}

/** Largest number of results. */
const MOST = 40;

/** Return the matching entries. Those that start with the text come first; without a text, recently used ones. */
export function found(entries: readonly Entry[], search: string, recent: readonly string[]): Entry[] {
  const parts = search.trim().toLowerCase().split(/\s+/).filter(Boolean);
  if (parts.length === 0) {
    const used = recent.flatMap((id) => entries.find((each) => each.id === id) ?? []);
    return [...used, ...entries.filter((each) => !recent.includes(each.id))].slice(0, MOST);
  }
  const fits = (each: Entry) => parts.every((part) => `${each.words} ${each.detail}`.toLowerCase().includes(part));
  const rank = (each: Entry) =>
    each.words.toLowerCase().startsWith(parts.join(" "))
      ? 0
      : each.words.toLowerCase().includes(parts[0] ?? "")
        ? 1
        : 2;
  return entries
    .filter(fits)
    .sort((a, b) => rank(a) - rank(b))
    .slice(0, MOST);
}
