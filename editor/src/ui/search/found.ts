/** Which entries of the search fit what is typed. */

export interface Entry {
  id: string;
  words: string;
  /** What kind of thing it is, or how it stands. */
  detail: string;
  /** Why it cannot be done now; empty: it can. */
  why: string;
  act: () => void;
}

/** Most things at once: who wants another types more. */
const MOST = 40;

/** Give all that fits the words, those first that begin with them, what was used last first where nothing is typed. */
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
