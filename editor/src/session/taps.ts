/** Who receives the next taps in the view instead of the selection: a tool that needs a position. */

import type { Vector3 } from "three";
import type { Hit } from "../engine/picking";

/** Return whether it handled the tap; then nothing is selected. */
export type TapTaker = (hits: Hit[], floor: Vector3 | null) => boolean;

let taker: TapTaker | null = null;

/** Receive taps from now on; return a function that ends it. */
export function takeTaps(by: TapTaker): () => void {
  taker = by;
  return () => {
    if (taker === by) taker = null;
  };
}

export function tapTaken(hits: Hit[], floor: Vector3 | null): boolean {
  return taker?.(hits, floor) ?? false;
}
