/** Results of runs. Every screen takes them from the run history of the server. */

import { t } from "@lingui/core/macro";
import type { Run } from "../protocol/types";
import { isRunning } from "../store/selectors";
import type { State } from "../store/state";

/** Key of the view state under which the number of the last dismissed result is stored for each user. */
const DISMISSED = "dismissed_run";

export interface Result {
  tone: "good" | "bad" | "warn" | "";
  /** "Run failed in scan". */
  title: string;
  /** Name of the package, or of the project if the package was temporary. */
  name: string;
  /** The error; empty if there was none. */
  detail: string;
  /** Id of the action in which the run failed; empty if unknown. */
  actionId: string;
}

/** Return the newest run, or the newest run of a project. */
export function lastRun(state: State, projectId?: string): Run | undefined {
  return state.program.runs.find((run) => projectId === undefined || run.project_id === projectId);
}

/** Return the result of a run; null while it is running. */
export function resultOf(run: Run | undefined): Result | null {
  if (!run || run.end === "running") return null;
  const name = (run.temporary && run.project_name) || run.package_name;
  const detail = run.end === "failed" || run.end === "lost" ? (run.error ?? "") : "";
  const result = { name, detail, actionId: run.last_action?.id ?? "" };
  const at = run.last_action?.name;
  switch (run.end) {
    case "finished":
      return { ...result, tone: "good", title: t`Run finished` };
    case "stopped":
      return { ...result, tone: "", title: run.stopped_by ? t`Run stopped by ${run.stopped_by}` : t`Run stopped` };
    case "failed":
      return { ...result, tone: "bad", title: at ? t`Run failed in ${at}` : t`Run failed` };
    case "lost":
      return { ...result, tone: "warn", title: at ? t`Run interrupted in ${at}` : t`Run interrupted` };
  }
}

/**
 * Return the newest run if its result has to be shown: until the user dismisses it or another run starts. A run that
 * finished or was stopped as intended is only shown to users who were connected while it was running.
 */
export function undismissedRun(state: State): Run | null {
  const run = lastRun(state);
  if (!run || run.end === "running" || isRunning(state)) return null;
  if (run.number <= Number(state.view.general[DISMISSED] ?? 0)) return null;
  const failed = run.end === "failed" || run.end === "lost";
  return failed || run.number === state.program.watched ? run : null;
}

/** Return the value to store when a user dismisses the result of a run. */
export const dismissal = (run: Run): Record<string, number> => ({ [DISMISSED]: run.number });
