/** Sequences of actions that can be folded. Pure functions. */

import type { OpenDocument } from "../store/state";
import { branchKind, incoming, outgoing, placeOf } from "./steps";

/** Fewest actions of a sequence that can be folded. */
const MIN_FOLDED = 3;

/** Return sequences of actions without branches in or out; each in its order. */
export function runsOf(doc: OpenDocument): string[][] {
  /** Return the only successor of an action, if the action is its only predecessor. */
  const onlyNext = (id: string): string | undefined => {
    const [step, ...others] = outgoing(doc, id);
    if (!step || others.length > 0 || branchKind(step) !== "always") return undefined;
    const next = placeOf(step.end);
    return next in doc.actions && incoming(doc, next).length === 1 ? next : undefined;
  };
  const found: string[][] = [];
  for (const id of Object.keys(doc.actions)) {
    const steps = incoming(doc, id);
    const before = steps.length === 1 ? placeOf(steps[0]?.start ?? "") : "";
    if (before in doc.actions && onlyNext(before) === id) continue; // not the first action of a sequence
    const run = [id];
    for (let next = onlyNext(id); next !== undefined && next !== id; next = onlyNext(next)) run.push(next);
    if (run.length >= MIN_FOLDED) found.push(run);
  }
  return found;
}

/** Return the folded sequences: those that the user folded, unless an action in them has to be visible. */
export function foldedRuns(doc: OpenDocument, chosen: ReadonlySet<string>, seen: ReadonlySet<string>): string[][] {
  return runsOf(doc).filter((run) => run.some((id) => chosen.has(id)) && !run.some((id) => seen.has(id)));
}
