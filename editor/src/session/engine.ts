/** The engine of the visible view, for panels and commands; null without a view. */

import type { Engine } from "../engine/engine";

let engine: Engine | null = null;

declare global {
  interface Window {
    /** For tests and the browser console. */
    __engine?: Engine | null;
  }
}

export function setEngine(of: Engine | null): void {
  engine = of;
  window.__engine = of;
}

export function theEngine(): Engine | null {
  return engine;
}
