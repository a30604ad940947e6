/** The engine of the visible view, for panels and commands; null without a view. */

import type { Engine } from "../engine/engine";
import { getState } from "../store/store";

declare module "../store/runtime" {
  interface Runtime {
    engine?: Engine | null;
  }
}

declare global {
  interface Window {
    /** For tests and the browser console. */
    __engine?: Engine | null;
  }
}

export function setEngine(engine: Engine | null): void {
  getState().runtime.engine = engine;
  window.__engine = engine;
}

export function theEngine(): Engine | null {
  return getState().runtime.engine ?? null;
}
