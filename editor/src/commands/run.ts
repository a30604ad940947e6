/** Run the open project, packages and single actions; breakpoints. */

import { t } from "@lingui/core/macro";
import type { ProgramStep } from "../protocol/types";
import { call, serves } from "../session/connection";
import { whyUnavailable } from "../store/permissions";
import { isClosed } from "../store/selectors";
import type { State } from "../store/state";
import { getState, notify } from "../store/store";
import { ask, sentence } from "./requests";

/** Time limit, s. A build copies the code of the drivers, which takes time on a busy computer. */
const BUILD_TIMEOUT = 120;

/** Return why the open project cannot be run now; an empty string if it can. */
export function notRunnable(state: State): string {
  if (!state.doc?.project) return t`Open a project first. A scene cannot be run.`;
  if (isClosed(state)) return t`The program is already running.`;
  if (state.live.state === "starting" || state.live.state === "stopping")
    return t`Wait until the devices are online or offline.`;
  if (state.live.executing) return t`An action is running. Wait until it ends, or press Stop motion.`;
  return whyUnavailable(state, "TemporaryPackage");
}

/** Options of a run: a failed action holds the program, so that a person can decide how it continues. */
const holdOnError = () => (serves("DecideHeld") ? { on_error: "hold" as const } : {});

/** Run the open project; save it first if necessary. Return whether it was started. */
export async function run({ paused = false } = {}): Promise<boolean> {
  try {
    if (getState().doc?.unsaved) await call("SaveProject");
    const shared = serves("SetBreakpoints")
      ? { shared_breakpoints: true }
      : { breakpoints: Object.keys(getState().breakpoints) };
    await call("TemporaryPackage", { start_paused: paused, ...shared, ...holdOnError() }, { deadline: BUILD_TIMEOUT });
    return true;
  } catch (error) {
    notify("error", t`Not started. ${sentence(error)}`);
    return false;
  }
}

/**
 * Run a package. `recipe`: id of the recipe and the order. `continues`: where it was interrupted, see `continues` of
 * the part inventory.
 */
export const runPackage = (id: string, paused = false, continues = false, recipe: object = {}) =>
  ask(
    "RunPackage",
    {
      id,
      start_paused: paused,
      ...(serves("SetBreakpoints") ? { shared_breakpoints: true } : {}),
      ...holdOnError(),
      ...(continues && { continues }),
      ...recipe,
    },
    { deadline: BUILD_TIMEOUT },
  );
export const pause = () => ask("PausePackage");
export const resume = () => ask("ResumePackage");
/**
 * Run until the next action: `into` a called function, `out` of the present one, or `over` a call. `branch`: the branch
 * that continues; by default the one that waits longest.
 */
export const step = (mode: ProgramStep = "over", branch?: string) =>
  ask("StepAction", { mode, ...(branch !== undefined && { branch }) });
/** Stop at once, without confirmation; the program can be started again. */
export const stop = () => ask("StopPackage");

/** Build a package of the open project; save it first if necessary. */
export async function build(name: string): Promise<boolean> {
  const { doc } = getState();
  if (!doc?.project) return false;
  if (doc.unsaved && !(await ask("SaveProject"))) return false;
  const built = await ask(
    "BuildProject",
    { project_id: doc.project.id, package_name: name },
    { deadline: BUILD_TIMEOUT },
  );
  if (built) notify("info", t`Package ${name} created.`);
  return built !== undefined;
}

/** Set or remove the breakpoint of a point or action, also while the program is running. */
export const breakAt = (id: string, on: boolean) =>
  ask("SetBreakpoints", { ...(on ? { add: [id] } : { remove: [id] }), project_id: getState().doc?.project?.id });

/** Run, and pause before this action. */
export async function runTo(id: string): Promise<void> {
  if (!(id in getState().breakpoints) && !(await breakAt(id, true))) return;
  await run();
}

/** Run one action on the devices; events report how it ends. */
export const execute = (action_id: string) => ask("ExecuteAction", { action_id });
export const cancel = () => ask("CancelAction");
