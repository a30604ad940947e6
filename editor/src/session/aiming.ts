/** The crosshair in the middle of the view: its candidates, and which one is chosen. */

import { create } from "zustand";
import { aimed, middle, targetsOf } from "../engine/aiming";
import type { Engine } from "../engine/engine";
import type { State } from "../store/state";
import { setUi } from "../store/store";

interface Aiming {
  /** A list of the candidates is open. */
  listed: boolean;
  /** Ids, most likely first. */
  candidates: string[];
  chosen: string;
}

const NOTHING = { candidates: [], chosen: "" };

export const useAiming = create<Aiming>(() => ({ listed: false, ...NOTHING }));

/** Return whether the crosshair is always shown: a setting of the user, stored on the server. */
export const aimsAlways = (state: State): boolean => state.view.general.aiming === true;

/** Report that a list of candidates is open, until the returned function is called. */
export function listAimed(): () => void {
  useAiming.setState({ listed: true });
  return () => useAiming.setState({ listed: false });
}

/** Choose the next or previous candidate, cyclically. */
export function nextCandidate(by: 1 | -1 = 1): void {
  const { candidates, chosen } = useAiming.getState();
  const next = candidates[(candidates.indexOf(chosen) + by + candidates.length) % candidates.length];
  if (next !== undefined) useAiming.setState({ chosen: next });
}

/**
 * Update the candidates with each frame; return a function that ends it. A chosen candidate is kept as long as it is
 * near the crosshair. `drawn` is called after each update.
 */
export function followCrosshair(engine: Engine, drawn: () => void): () => void {
  let best = "";
  let reported = "";
  const look = () => {
    const { things, height } = engine.shown();
    const { ray, cone } = middle(engine.view.camera, height);
    const ids = aimed(targetsOf(things.values()), ray, cone, best).map((each) => each.id);
    const { candidates, chosen } = useAiming.getState();
    const stays = chosen !== best && ids.includes(chosen);
    best = ids[0] ?? "";
    const next = stays ? chosen : best;
    if (next !== chosen || ids.length !== candidates.length || ids.some((each, n) => each !== candidates[n]))
      useAiming.setState({ candidates: ids, chosen: next });
    engine.hover(next);
    drawn();
    if (next === reported) return;
    reported = next;
    setUi({ aimed: next || undefined });
  };
  const end = engine.watch(look);
  look();
  return () => {
    end();
    engine.hover("");
    useAiming.setState(NOTHING);
    setUi({ aimed: undefined });
  };
}
