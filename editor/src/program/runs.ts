/** Sequences of actions that can be folded. Pure functions. */

import type { OpenDocument } from "../store/state";
import { END, incoming, outgoing, placeOf } from "./logic";

/** Fewest actions of a sequence that can be folded. */
export const LEAST_FOLDED = 3;

/** Return sequences of actions without branches in or out; each in its order. */
export function runsOf(doc: OpenDocument): string[][] {
  /** Return the only successor of an action, if the action is its only predecessor. */
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
    if (before in doc.actions && onlyNext(before) === id) continue; // not the first action of a sequence
    const run = [id];
    for (let next = onlyNext(id); next !== undefined && next !== id; next = onlyNext(next)) run.push(next);
    if (run.length >= LEAST_FOLDED) found.push(run);
  }
  return found;
}

/** Return the folded sequences: those that the user folded, unless an action in them has to be visible. */
export function foldedRuns(doc: OpenDocument, wished: ReadonlySet<string>, seen: ReadonlySet<string>): string[][] {
  return runsOf(doc).filter((run) => run.some((id) => wished.has(id)) && !run.some((id) => seen.has(id)));
}
