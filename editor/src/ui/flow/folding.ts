/** Which runs of actions are folded into one node: as the user wants it on all his tablets, but for what is to be seen. */

import { useMemo, useRef } from "react";
import { keepView } from "../../commands/viewstate";
import type { Problem } from "../../program/problems";
import { foldedRuns, runsOf } from "../../program/runs";
import { isRunning } from "../../store/selectors";
import { now, useEditor } from "../../store/store";

const KEY = "folded";
const NONE: string[] = [];

function wishedOf(kept: unknown): string[] {
  return Array.isArray(kept) && kept.length > 0 ? kept.filter((each) => typeof each === "string") : NONE;
}

const keep = (ids: Iterable<string>): void => {
  const doc = now().doc;
  // What is gone is forgotten.
  const known = [...new Set(ids)].filter((id) => doc && id in doc.actions);
  keepView("user", { [KEY]: known.length > 0 ? known : null });
};

/** All actions of a run are kept, so that it stays folded when its first one goes, or another comes before it. */
export const fold = (run: readonly string[]): void => keep([...wishedOf(now().view.user[KEY]), ...run]);

export const unfold = (run: readonly string[]): void =>
  keep(wishedOf(now().view.user[KEY]).filter((id) => !run.includes(id)));

export function foldAll(on: boolean): void {
  const { doc } = now();
  keep(on && doc ? runsOf(doc).flat() : NONE);
}

export interface Folds {
  /** How many runs could be folded. */
  runs: number;
  /** Some are wished folded. */
  wished: boolean;
  folded: string[][];
}

/** What runs, was tried or selected last, or has a problem, is seen: its run is open meanwhile. */
export function useFolds(problems: readonly Problem[]): Folds {
  const doc = useEditor((state) => state.doc);
  const kept = useEditor((state) => state.view.user[KEY]);
  const running = useEditor((state) => state.program.running);
  const active = useEditor(isRunning);
  const executing = useEditor((state) => state.live.executing);
  const selected = useEditor((state) => state.ui.selection?.id ?? "");
  const from = useEditor((state) => state.ui.connecting?.from ?? "");
  // Between two actions none runs: what ran last stays open until the next one does.
  const ran = useRef<string[]>(NONE);
  if (!active) ran.current = NONE;
  else if (running.length > 0) ran.current = running;
  const last = ran.current;
  return useMemo(() => {
    if (!doc) return { runs: 0, wished: false, folded: [] };
    const wished = wishedOf(kept);
    const runs = runsOf(doc);
    const seen = new Set([...last, executing, selected, from, ...problems.map((each) => each.id)]);
    return {
      runs: runs.length,
      wished: runs.some((run) => run.some((id) => wished.includes(id))),
      folded: foldedRuns(doc, new Set(wished), seen),
    };
  }, [doc, kept, last, executing, selected, from, problems]);
}
