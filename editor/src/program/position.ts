/** The position of the running program: the calls around the present actions. Pure functions. */

import { anyAction } from "../store/scope";
import type { State } from "../store/state";
import { calledBy } from "./operands";

/** Return the ids of the calls around a running action and of the action itself, outermost first. */
export function stackOf({ doc, program }: State, id: string): string[] {
  const branch = program.position?.branches.find((each) => each.frames.at(-1)?.action_id === id);
  if (branch) return branch.frames.map((each) => each.action_id);
  // The position may arrive after the action.
  const stack = [id];
  const calls = doc
    ? program.running.flatMap((each) => {
        const called = calledBy(doc, anyAction(doc, each));
        return called ? [{ id: each, called }] : [];
      })
    : [];
  for (let top = id; ; ) {
    const call = calls.find((each) => top in each.called.actions && !stack.includes(each.id));
    if (!call) return stack;
    stack.unshift(call.id);
    top = call.id;
  }
}

/** Return the innermost running actions: not the calls around them. */
export function innermost(state: State): string[] {
  const { doc, program } = state;
  const within = new Set(program.running.flatMap((id) => stackOf(state, id).slice(0, -1)));
  // Parallel work is around its branches.
  const around = (id: string) => doc && anyAction(doc, id)?.branches?.some((each) => program.running.includes(each));
  return program.running.filter((id) => !within.has(id) && !around(id));
}

/** Return an action with the calls around it: "handle_board › pick". */
export const pathWords = (state: State, id: string): string =>
  stackOf(state, id)
    .flatMap((each) => (state.doc && anyAction(state.doc, each)?.name) || [])
    .join(" › ");

/** Return the running actions as text. */
export const doingWords = (state: State): string =>
  innermost(state)
    .map((id) => pathWords(state, id))
    .filter(Boolean)
    .join(", ");
