/** Asks for what belongs to programs and comes by no event at first: actions of types, runs, the trace of what runs. */

import { isRunning } from "../store/selectors";
import type { State } from "../store/state";
import { now, store } from "../store/store";
import { actionsOf, call, serves } from "./session";

const asked = new Set<string>();
let runsAsked = false;
let traced = false;

export function forgetPrograms(): void {
  asked.clear();
  runsAsked = traced = false;
}

/** Called with each state. */
export function followPrograms(state: State): void {
  if (state.connection.status !== "ready") return;
  followActions(state);
  if (!runsAsked && serves("ListRuns")) {
    runsAsked = true;
    void call("ListRuns", { limit: 100 }).then(({ runs }) => store.setState(({ program }) => ({ program: { ...program, runs } })), () => {});
  }
  // Who comes while a program runs sees what it has done so far.
  if (isRunning(state) && !traced && serves("GetExecutionTrace")) {
    traced = true;
    void call("GetExecutionTrace", { limit: 1000 }).then(takeTrace, () => {});
  }
  if (!isRunning(state)) traced = false;
}

function followActions(state: State): void {
  if (!state.doc?.project) return;
  for (const { type } of Object.values(state.doc.objects)) {
    if (!(type in state.types.byName)) continue;
    if (type in state.types.actions) asked.delete(type); // it is asked for again when the type was changed
    else if (!asked.has(type)) {
      asked.add(type);
      actionsOf(type).catch(() => {});
    }
  }
}

function takeTrace({ run, entries }: { run: number; entries: State["program"]["trace"] }): void {
  const known = now().program.trace.filter((each) => each.run === run);
  const newer = new Set(known.map((each) => each.number));
  const trace = [...entries.filter((each) => !newer.has(each.number)), ...known].sort((a, b) => a.number - b.number);
  store.setState(({ program }) => ({ program: { ...program, trace } }));
}
