/** The error exit that a running program takes. */

import type { LogicItem } from "../protocol/types";
import { isRunning } from "../store/selectors";
import type { State } from "../store/state";
import { END, errorExits, outgoing, placeOf, START } from "./steps";

/** Return the error exit that the running program took last, until its next cycle; undefined if it took none. */
export function takenExit(state: State): LogicItem | undefined {
  const { doc, program } = state;
  if (!doc || !isRunning(state)) return undefined;
  const trace = program.trace.filter((each) => each.action_id in doc.actions); // not those of functions that it calls
  const failed = trace.findLastIndex((each) => each.error !== undefined);
  const entry = trace[failed];
  if (!entry) return undefined;
  const later = trace.slice(failed + 1).filter((each) => each.thread_id === entry.thread_id);
  if (later[0]?.attempt !== undefined) return undefined; // the action is repeated
  const first = placeOf(outgoing(doc, START)[0]?.end ?? "");
  const exits = errorExits(doc, entry.action_id);
  const next = later[0]?.action_id;
  if (next === undefined || later.some((each) => each.action_id === first)) {
    const back = next === first && later.length === 1;
    return back ? exits.find((each) => placeOf(each.end) === END) : undefined;
  }
  return exits.find((each) => placeOf(each.end) === next);
}
