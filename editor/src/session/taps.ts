/** Who takes the next taps in the view instead of selecting: a tool that asks for a place. */

import type { Vector3 } from "three";
import type { Hit } from "../engine/picking";

/** Gives whether it took the tap; then nothing is selected by it. */
export type TapTaker = (hits: Hit[], floor: Vector3 | null) => boolean;

let taker: TapTaker | null = null;

/** Take taps from now on; gives what ends that. */
export function takeTaps(by: TapTaker): () => void {
  taker = by;
  return () => {
    if (taker === by) taker = null;
  };
}

export function tapTaken(hits: Hit[], floor: Vector3 | null): boolean {
  return taker?.(hits, floor) ?? false;
}
