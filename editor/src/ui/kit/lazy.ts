/** Parts of the page that are loaded when they are needed, with retries while the server is disconnected. */

import { type ComponentType, type LazyExoticComponent, lazy } from "react";
import { persistently } from "../../persistently";

// biome-ignore lint/suspicious/noExplicitAny: a component with any properties.
export function lazyComponent<C extends ComponentType<any>>(
  load: () => Promise<{ default: C }>,
): LazyExoticComponent<C> {
  return lazy(() => persistently(load));
}
