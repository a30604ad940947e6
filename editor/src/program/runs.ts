/** Straight runs of actions, which can be folded into one: pure. */

import type { OpenDocument } from "../store/state";
import { END, incoming, outgoing, placeOf } from "./logic";

/** So many actions at least: fewer are as easily read as their number. */
export const LEAST_FOLDED = 3;

/** Runs of actions that follow each other in any case, with no other way in or out between them; each in its order. */
export function runsOf(doc: OpenDocument): string[][] {
  /** What follows an action and nothing else; only where nothing else leads there. */
  const onlyNext = (id: string): string | undefined => {
    const ways = outgoing(doc, id);
    const next = placeOf(ways[0]?.end ?? END);
    return ways.length === 1 && !ways[0]?.condition && next in doc.actions && incoming(doc, next).length === 1
      ? next
      : undefined;
  };
  const found: string[][] = [];
  for (const id of Object.keys(doc.actions)) {
    const ways = incoming(doc, id);
    const before = ways.length === 1 ? placeOf(ways[0]?.start ?? "") : "";
    if (before in doc.actions && onlyNext(before) === id) continue; // not where a run begins
    const run = [id];
    for (let next = onlyNext(id); next !== undefined && next !== id; next = onlyNext(next)) run.push(next);
    if (run.length >= LEAST_FOLDED) found.push(run);
  }
  return found;
}

/** The runs that are folded: those of which an action is wished folded, and none is to be seen. */
export function foldedRuns(doc: OpenDocument, wished: ReadonlySet<string>, seen: ReadonlySet<string>): string[][] {
  return runsOf(doc).filter((run) => run.some((id) => wished.has(id)) && !run.some((id) => seen.has(id)));
}
