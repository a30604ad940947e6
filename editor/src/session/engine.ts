/** The engine of the view that is on the screen, for panels and commands; null while there is none. */

import type { Engine } from "../engine/engine";

let engine: Engine | null = null;

declare global {
  interface Window {
    /** For tests, and for who looks into the console. */
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
