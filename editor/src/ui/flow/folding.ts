/** Sequences of actions that are folded into one node. The user's choice is stored on the server for all devices. */

import { useMemo, useRef } from "react";
import { storeViewState } from "../../commands/viewstate";
import type { Problem } from "../../program/problems";
import { foldedRuns, runsOf } from "../../program/runs";
import { isRunning } from "../../store/selectors";
import { getState, useEditor } from "../../store/store";

const KEY = "folded";
const NONE: readonly string[] = [];

function storedFolds(stored: unknown): readonly string[] {
  return Array.isArray(stored) && stored.length > 0 ? stored.filter((each) => typeof each === "string") : NONE;
}

const storeFolds = (ids: Iterable<string>): void => {
  const doc = getState().doc;
  // Remove folds of deleted actions.
  const known = [...new Set(ids)].filter((id) => doc && id in doc.actions);
  storeViewState("user", { [KEY]: known.length > 0 ? known : null });
};

/** Store all actions of a sequence, so that it stays folded when its first action changes. */
export const fold = (run: readonly string[]): void => storeFolds([...storedFolds(getState().view.user[KEY]), ...run]);

export const unfold = (run: readonly string[]): void =>
  storeFolds(storedFolds(getState().view.user[KEY]).filter((id) => !run.includes(id)));

export function foldAll(on: boolean): void {
  const { doc } = getState();
  storeFolds(on && doc ? runsOf(doc).flat() : NONE);
}

interface Folds {
  /** Return the number of sequences that can be folded. */
  runs: number;
  /** Return whether the user has folded any. */
  chosen: boolean;
  folded: string[][];
}

/** A sequence is unfolded while one of its actions is running, was run or selected last, or has a problem. */
export function useFolds(problems: readonly Problem[]): Folds {
  const doc = useEditor((state) => state.doc);
  const stored = useEditor((state) => state.view.user[KEY]);
  const running = useEditor((state) => state.program.running);
  const active = useEditor(isRunning);
  const executing = useEditor((state) => state.live.executing);
  const selected = useEditor((state) => state.ui.selection?.id ?? "");
  const from = useEditor((state) => state.ui.connecting?.from ?? "");
  // Between two actions none is running: keep the last one visible until the next one starts.
  const ran = useRef<readonly string[]>(NONE);
  if (!active) ran.current = NONE;
  else if (running.length > 0) ran.current = running;
  const last = ran.current;
  return useMemo(() => {
    if (!doc) return { runs: 0, chosen: false, folded: [] };
    const chosen = storedFolds(stored);
    const runs = runsOf(doc);
    const seen = new Set([...last, executing, selected, from, ...problems.map((each) => each.id)]);
    return {
      runs: runs.length,
      chosen: runs.some((run) => run.some((id) => chosen.includes(id))),
      folded: foldedRuns(doc, new Set(chosen), seen),
    };
  }, [doc, stored, last, executing, selected, from, problems]);
}
