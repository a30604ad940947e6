/** Request the data of programs that events only update: actions, run history, trace of the running program. */

import { inUserLanguage } from "../i18n/serverMessages";
import { SERVICES } from "../program/services";
import type { ProgramPosition } from "../protocol/types";
import { withRuns } from "../store/reduce";
import { isRunning } from "../store/selectors";
import type { State } from "../store/state";
import { getState, store } from "../store/store";
import { call, serves } from "./connection";
import type { Follower } from "./follower";
import { loadActions } from "./lists";

export class ProgramDetails implements Follower {
  /** Types whose actions were requested. */
  private readonly types = new Set<string>();
  /** Projects whose runs were requested; the empty string stands for the newest runs of all projects. */
  private readonly runs = new Set<string>();
  private traced = false;

  reset(): void {
    this.types.clear();
    this.runs.clear();
    this.traced = false;
  }

  follow(state: State): void {
    if (state.connection.status !== "ready") return;
    this.followActions(state);
    this.followRuns(state);
    // A user who joins while a program is running sees its trace from the start.
    if (isRunning(state) && !this.traced && serves("GetExecutionTrace")) {
      this.traced = true;
      void call("GetExecutionTrace", { limit: 1000 }).then(takeTrace, () => {});
      // The calls around the present action were announced before.
      if (serves("GetProgramPosition")) void call("GetProgramPosition").then(takePosition, () => {});
    }
    if (!isRunning(state)) this.traced = false;
  }

  /** Request the newest runs, and those of the open project, which may be older. */
  private followRuns(state: State): void {
    if (!serves("ListRuns")) return;
    for (const project_id of ["", state.doc?.project?.id ?? ""]) {
      if (this.runs.has(project_id)) continue;
      this.runs.add(project_id);
      const wanted = project_id ? { limit: 20, project_id } : { limit: 100 };
      void call("ListRuns", wanted).then(
        ({ runs }) => store.setState(({ program }) => ({ program: withRuns(program, runs.map(inUserLanguage)) })),
        () => {},
      );
    }
  }

  private followActions(state: State): void {
    if (!state.doc?.project) return;
    for (const type of [...Object.values(state.doc.objects).map((each) => each.type), ...SERVICES]) {
      if (!(type in state.types.byName)) continue;
      if (type in state.types.actions)
        this.types.delete(type); // requested again when the type changes
      else if (!this.types.has(type)) {
        this.types.add(type);
        loadActions(type).catch(() => {});
      }
    }
  }
}

function takePosition(position: ProgramPosition): void {
  const ids = position.branches.flatMap(({ frames }) => frames.slice(0, -1).map((each) => each.action_id));
  store.setState(({ program }) => {
    const running = [...ids, ...program.running.filter((id) => !ids.includes(id))];
    return { program: { ...program, position, running: isRunning(getState()) ? running : program.running } };
  });
}

function takeTrace({ run, entries }: { run: number; entries: State["program"]["trace"] }): void {
  const known = getState().program.trace.filter((each) => each.run === run);
  const newer = new Set(known.map((each) => each.number));
  const older = entries.filter((each) => !newer.has(each.number)).map(inUserLanguage);
  const trace = [...older, ...known].sort((a, b) => a.number - b.number);
  store.setState(({ program }) => ({ program: { ...program, trace } }));
}
