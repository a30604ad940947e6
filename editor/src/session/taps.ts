/** Taps in the view for a tool that needs a position. They do not change the selection. */

import type { Vector3 } from "three";
import type { Hit } from "../engine/picking";
import { getState } from "../store/store";

/** Handles a tap and returns true, or returns false so that the tap selects an item. */
type TapHandler = (hits: Hit[], floor: Vector3 | null) => boolean;

declare module "../store/runtime" {
  interface Runtime {
    tapHandler?: TapHandler | undefined;
  }
}

/** Pass the taps to a handler from now on. Return a function that removes the handler. */
export function takeTaps(handler: TapHandler): () => void {
  const { runtime } = getState();
  runtime.tapHandler = handler;
  return () => {
    if (runtime.tapHandler === handler) runtime.tapHandler = undefined;
  };
}

/** Pass a tap to the handler. Return whether it was handled. */
export function handleTap(hits: Hit[], floor: Vector3 | null): boolean {
  return getState().runtime.tapHandler?.(hits, floor) ?? false;
}
