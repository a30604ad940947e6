/** The cross in the middle of the view: what it may mean, and which of that is taken next. */

import { create } from "zustand";
import { aimed, middle, targetsOf } from "../engine/aiming";
import type { Engine } from "../engine/engine";
import type { State } from "../store/state";
import { setUi } from "../store/store";

interface Aiming {
  /** A list of what is at the cross is open. */
  listed: boolean;
  /** Ids, the likeliest first. */
  candidates: string[];
  chosen: string;
}

const NOTHING = { candidates: [], chosen: "" };

export const useAiming = create<Aiming>(() => ({ listed: false, ...NOTHING }));

/** Whether the user picks by the cross: kept by the server, for all his tablets. */
export const aimsAlways = (state: State): boolean => state.view.general.aiming === true;

/** Say that a list of it is open, until what this gives is called. */
export function listAimed(): () => void {
  useAiming.setState({ listed: true });
  return () => useAiming.setState({ listed: false });
}

/** Go on to the next candidate, or back; from the last to the first. */
export function nextCandidate(by: 1 | -1 = 1): void {
  const { candidates, chosen } = useAiming.getState();
  const next = candidates[(candidates.indexOf(chosen) + by + candidates.length) % candidates.length];
  if (next !== undefined) useAiming.setState({ chosen: next });
}

/**
 * Look with each drawn frame what the cross may mean; gives what ends that. Who went on to another candidate keeps it
 * as long as it is near the cross. `drawn` is called after each look.
 */
export function followCross(engine: Engine, drawn: () => void): () => void {
  let best = "";
  let told = "";
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
    if (next === told) return;
    told = next;
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
