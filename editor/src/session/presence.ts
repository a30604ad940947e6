/** Report to the other users what this user selects and edits. */

import type { Presence } from "../protocol/types";
import { openId } from "../store/selectors";
import type { State } from "../store/state";
import { getState } from "../store/store";
import { call, serves } from "./connection";
import type { Follower } from "./follower";

/** Time between two reports, s. */
const PERIOD = 0.2;

/** Return whether the operator screen is shown. It uses no document, so it does not prevent a program from starting. */
function atOperatorScreen(): boolean {
  return typeof location !== "undefined" && location.hash.startsWith("#/operator");
}

function presenceOf(state: State): Presence {
  if (atOperatorScreen()) return { document: "", selected: [], view: "operator" };
  const { selection, aimed } = state.ui;
  return {
    document: openId(state),
    selected: selection ? [selection.id] : [],
    ...(aimed ? { aimed } : {}),
    ...(state.ui.draft ? { editing: state.ui.draft.id } : {}),
    view: state.ui.ar ? "ar" : state.doc ? "3d" : "home",
    ...(state.ui.ar?.camera && { camera: state.ui.ar.camera }),
  };
}

export class PresenceReporter implements Follower {
  private reported = "";
  private timer: ReturnType<typeof setTimeout> | undefined;

  reset(): void {
    this.reported = "";
  }

  follow(state: State): void {
    if (state.connection.status !== "ready" || this.timer !== undefined) return;
    if (JSON.stringify(presenceOf(state)) === this.reported) return;
    this.timer = setTimeout(() => {
      this.timer = undefined;
      const latest = getState();
      if (latest.connection.status !== "ready" || !serves("UpdatePresence")) return;
      const presence = presenceOf(latest);
      this.reported = JSON.stringify(presence);
      call("UpdatePresence", presence).catch(() => {}); // reported again with the next change
    }, PERIOD * 1000);
  }
}
