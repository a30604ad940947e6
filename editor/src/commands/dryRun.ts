/** Dry runs of the open project, and the timing of earlier runs. */

import { t } from "@lingui/core/macro";
import { translate } from "../i18n/serverMessages";
import type { GetDryRunData, RunTrace, StartDryRunArgs, TraceSummary } from "../protocol/types";
import { call, serves } from "../session/connection";
import { rest } from "../session/rest";
import { whyUnavailable } from "../store/permissions";
import type { State } from "../store/state";
import { getState, store } from "../store/store";
import { ask, sentence } from "./requests";

/** The cycle time, bottleneck and waits of a run or dry run. */
export interface Timing {
  /** `dry` and a number, or `run` and a number. */
  key: string;
  trace: RunTrace;
  summary: TraceSummary;
}

/** Return why a dry run cannot be started; an empty string if it can. */
export function notPredictable(state: State): string {
  if (!state.doc?.project) return t`Open a project first.`;
  if (!serves("StartDryRun")) return t`This server has no dry runs.`;
  return whyUnavailable(state, "StartDryRun");
}

export const startDryRun = (choice: StartDryRunArgs = {}) => ask("StartDryRun", choice);
export const cancelDryRun = () => ask("CancelDryRun");

/** Return a dry run with translated texts, by default the newest one of the open project; null if there is none. */
async function loadDryRun(number?: number): Promise<GetDryRunData | null> {
  if (!serves("GetDryRun")) return null;
  try {
    const found = await call("GetDryRun", number === undefined ? {} : { number });
    const { prediction } = found;
    if (!prediction) return found;
    const { problem } = prediction;
    return {
      ...found,
      prediction: {
        ...prediction,
        assumptions: prediction.assumptions.map((each) => ({ ...each, text: translate(each) })),
        ...(problem && { problem: { ...problem, reason: translate({ ...problem, text: problem.reason }) } }),
      },
    };
  } catch {
    return null; // there is none
  }
}

/** Return the timing with a key. Reject with a sentence if it is not available. */
export async function loadTiming(key: string): Promise<Timing> {
  const [kind, number] = key.split(" ");
  if (kind === "dry") {
    const found = await loadDryRun(Number(number));
    if (!found?.prediction) throw new Error(t`This dry run is no longer stored.`);
    return { key, trace: found.prediction.trace, summary: found.prediction.summary };
  }
  const [trace, summary] = await Promise.all([
    rest(`/api/runs/${number}/trace`).then((each) => each.json() as Promise<RunTrace>),
    rest(`/api/runs/${number}/summary`).then((each) => each.json() as Promise<TraceSummary>),
  ]);
  return { key, trace, summary };
}

/** Load a dry run of the open project into the store; 0: the newest one. */
export async function showDryRun(project: string | undefined, number: number): Promise<void> {
  if (project === undefined) return;
  const found = await loadDryRun(number || undefined);
  if (getState().doc?.project?.id !== project) return;
  store.setState(({ program }) => ({ program: { ...program, dryRun: found } }));
}

export { sentence };
