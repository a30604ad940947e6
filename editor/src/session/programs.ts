/** Request the data of programs that events only update: actions of types, the run history, the trace of the running program. */

import { withRuns } from "../store/reduce";
import { isRunning } from "../store/selectors";
import type { State } from "../store/state";
import { now, store } from "../store/store";
import { actionsOf, call, serves } from "./session";

const asked = new Set<string>();
/** Projects whose runs were requested; the empty string stands for the newest runs of all projects. */
const runsAsked = new Set<string>();
let traced = false;

export function forgetPrograms(): void {
  asked.clear();
  runsAsked.clear();
  traced = false;
}

/** Called with each state. */
export function followPrograms(state: State): void {
  if (state.connection.status !== "ready") return;
  followActions(state);
  followRuns(state);
  // A user who joins while a program is running sees its trace from the start.
  if (isRunning(state) && !traced && serves("GetExecutionTrace")) {
    traced = true;
    void call("GetExecutionTrace", { limit: 1000 }).then(takeTrace, () => {});
  }
  if (!isRunning(state)) traced = false;
}

/** Request the newest runs, and those of the open project, which may be older. */
function followRuns(state: State): void {
  if (!serves("ListRuns")) return;
  for (const project_id of ["", state.doc?.project?.id ?? ""]) {
    if (runsAsked.has(project_id)) continue;
    runsAsked.add(project_id);
    const wanted = project_id ? { limit: 20, project_id } : { limit: 100 };
    void call("ListRuns", wanted).then(
      ({ runs }) => store.setState(({ program }) => ({ program: withRuns(program, runs) })),
      () => {},
    );
  }
}

function followActions(state: State): void {
  if (!state.doc?.project) return;
  for (const { type } of Object.values(state.doc.objects)) {
    if (!(type in state.types.byName)) continue;
    if (type in state.types.actions)
      asked.delete(type); // it is asked for again when the type was changed
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
