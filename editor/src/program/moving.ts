/** Moving an action within a straight sequence. Pure functions. */

import { t } from "@lingui/core/macro";
import type { OpenDocument } from "../store/state";
import { decoded } from "./json";
import { branchKind, incoming, outgoing, placeOf } from "./steps";

/**
 * Return for each action that can be moved the actions among which it can, in their order. Each has one next step
 * without a condition, and no error exit; all but the first have one predecessor.
 */
export function movableRuns(doc: OpenDocument): Map<string, readonly string[]> {
  const plain = (id: string) => {
    const [step, ...others] = outgoing(doc, id);
    return id in doc.actions && step !== undefined && others.length === 0 && branchKind(step) === "always";
  };
  /** Return the action before, if the two are always executed in sequence. */
  const previous = (id: string) => {
    const [step, ...others] = incoming(doc, id);
    const before = placeOf(step?.start ?? "");
    return others.length === 0 && plain(before) ? before : undefined;
  };
  const found = new Map<string, readonly string[]>();
  for (const first of Object.keys(doc.actions)) {
    if (!plain(first) || previous(first) !== undefined || incoming(doc, first).length === 0) continue;
    const run = [first];
    for (let at = first; ; ) {
      const next = placeOf(outgoing(doc, at)[0]?.end ?? "");
      if (!plain(next) || previous(next) !== at) break;
      run.push(next);
      at = next;
    }
    if (run.length > 1) for (const id of run) found.set(id, run);
  }
  return found;
}

/** The changes of the connections. The connection between the action and its successor is removed first. */
export interface Move {
  remove: string;
  /** Connections that lead elsewhere from now on, in this order. */
  redirect: { id: string; end: string }[];
  /** The new connection. */
  add: { start: string; end: string };
}

/** Return the move of an action to a place of `movableRuns`; a sentence if it is not possible. */
export function moveOf(doc: OpenDocument, id: string, to: number): Move | string {
  const run = movableRuns(doc).get(id) ?? [];
  const from = run.indexOf(id);
  const own = outgoing(doc, id)[0];
  const target = run[to];
  if (from < 0 || !own || target === undefined || to === from) return t`The action cannot be moved there.`;
  const passed = to > from ? run.slice(from + 1, to + 1) : run.slice(to, from);
  for (const other of passed) {
    const [later, earlier] = to > from ? [other, id] : [id, other];
    if (uses(doc, later, earlier))
      return t`${doc.actions[later]?.name ?? ""} uses a result of ${doc.actions[earlier]?.name ?? ""}.`;
  }
  const closing = incoming(doc, id).map((item) => ({ id: item.id, end: own.end }));
  if (to > from) {
    const step = outgoing(doc, target)[0];
    if (!step) return t`The action cannot be moved there.`;
    return {
      remove: own.id,
      redirect: [...closing, { id: step.id, end: id }],
      add: { start: id, end: step.end },
    };
  }
  const opening = incoming(doc, target).map((item) => ({ id: item.id, end: id }));
  return { remove: own.id, redirect: [...closing, ...opening], add: { start: id, end: target } };
}

/** Return whether an action uses a result of another one. */
function uses(doc: OpenDocument, action: string, other: string): boolean {
  return (doc.actions[action]?.parameters ?? []).some(
    ({ type, value }) => type === "link" && String(decoded(value)).split("/")[0] === other,
  );
}
