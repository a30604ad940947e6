/** Parts of the page that are loaded when they are needed, with retries while the server is disconnected. */

import { type ComponentType, type LazyExoticComponent, lazy } from "react";

/** Delays before each further attempt, s; the last one is repeated. */
const PAUSES = [0.5, 1, 2, 4];

/** Repeat until the module is loaded: a lazy component that failed once would fail for good. */
export async function persistently<T>(load: () => Promise<T>): Promise<T> {
  for (let attempt = 0; ; attempt++) {
    try {
      return await load();
    } catch {
      const pause = PAUSES[Math.min(attempt, PAUSES.length - 1)] ?? 1;
      await new Promise((resolve) => setTimeout(resolve, pause * 1000));
    }
  }
}

// biome-ignore lint/suspicious/noExplicitAny: a component with any properties.
export function lazyComponent<C extends ComponentType<any>>(
  load: () => Promise<{ default: C }>,
): LazyExoticComponent<C> {
  return lazy(() => persistently(load));
}
