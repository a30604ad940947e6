/** Tells the others what this user looks at and works on; not more often than they can follow. */

import type { Presence } from "../protocol/types";
import { openId } from "../store/selectors";
import type { State } from "../store/state";
import { call, serves } from "./session";

/** s between two messages. */
const PAUSE = 0.2;

let told = "";
let timer: ReturnType<typeof setTimeout> | undefined;

export function forgetPresence(): void {
  told = "";
}

/** The operator's screen shows no document: what is open there does not keep a program from starting. */
function atOperatorScreen(): boolean {
  return typeof location !== "undefined" && location.hash.startsWith("#/operator");
}

export function presenceOf(state: State): Presence {
  if (atOperatorScreen()) return { document: "", selected: [], view: "operator" };
  const { selection, aimed } = state.ui;
  return {
    document: openId(state),
    selected: selection ? [selection.id] : [],
    ...(aimed ? { aimed } : {}),
    ...(state.ui.draft ? { editing: state.ui.draft.id } : {}),
    view: state.doc ? "3d" : "home",
  };
}

/** Called with each state. */
export function tellPresence(state: State, latest: () => State): void {
  if (state.connection.status !== "ready" || timer !== undefined) return;
  if (JSON.stringify(presenceOf(state)) === told) return;
  timer = setTimeout(() => {
    timer = undefined;
    const now = latest();
    if (now.connection.status !== "ready" || !serves("UpdatePresence")) return;
    const presence = presenceOf(now);
    told = JSON.stringify(presence);
    call("UpdatePresence", presence).catch(() => {}); // it is told again with the next change
  }, PAUSE * 1000);
}
