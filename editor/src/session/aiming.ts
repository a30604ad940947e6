/** The crosshair in the middle of the view: its candidates, and which one is chosen. */

import { aimed, middle, targetsOf } from "../engine/aiming";
import type { Engine } from "../engine/engine";
import type { State } from "../store/state";
import { getState, setUi } from "../store/store";
import type { Crosshair } from "../store/ui";

function setCrosshair(change: Partial<Crosshair>): void {
  setUi({ crosshair: { ...getState().ui.crosshair, ...change } });
}

/** Choose a candidate. */
export const chooseCandidate = (chosen: string): void => setCrosshair({ chosen });

/** Return whether the crosshair is always shown: a setting of the user, stored on the server. */
export const aimsAlways = (state: State): boolean => state.view.general.aiming === true;

/** Report that a list of candidates is open, until the returned function is called. */
export function listAimed(): () => void {
  setCrosshair({ listed: true });
  return () => setCrosshair({ listed: false });
}

/** Choose the next or previous candidate, cyclically. */
export function nextCandidate(by: 1 | -1 = 1): void {
  const { candidates, chosen } = getState().ui.crosshair;
  const next = candidates[(candidates.indexOf(chosen) + by + candidates.length) % candidates.length];
  if (next !== undefined) chooseCandidate(next);
}

/**
 * Update the candidates with each frame; return a function that stops it. A chosen candidate stays chosen as long as it
 * is near the crosshair. `drawn` is called after each update.
 */
export function followCrosshair(engine: Engine, drawn: () => void): () => void {
  let best = "";
  let reported = "";
  const update = () => {
    const { things, height } = engine.shown();
    const { ray, cone } = middle(engine.view.camera, height);
    const ids = aimed(targetsOf(things.values()), ray, cone, best).map((each) => each.id);
    const { candidates, chosen } = getState().ui.crosshair;
    const stays = chosen !== best && ids.includes(chosen);
    best = ids[0] ?? "";
    const next = stays ? chosen : best;
    if (next !== chosen || ids.length !== candidates.length || ids.some((each, n) => each !== candidates[n]))
      setCrosshair({ candidates: ids, chosen: next });
    engine.hover(next);
    drawn();
    if (next === reported) return;
    reported = next;
    setUi({ aimed: next || undefined });
  };
  const end = engine.watch(update);
  update();
  return () => {
    end();
    engine.hover("");
    setCrosshair({ candidates: [], chosen: "" });
    setUi({ aimed: undefined });
  };
}
