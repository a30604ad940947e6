/**
 * Asking for what somebody else holds. The protocol has no request for it: by agreement of our clients the wish stands
 * in the shared view state of the document, as `asked/<id>`, until the thing is free. An existing client does not hear it.
 */

import type { State } from "./state";

const KEY = "asked/";
/** ms after which a wish is no news any more. */
const STALE = 10 * 60_000;

interface Wish {
  by: string;
  /** As `Date.now()` of who asked. */
  at: number;
}

function wish(value: unknown): Wish | null {
  const { by, at } = (value ?? {}) as Record<string, unknown>;
  return typeof by === "string" && typeof at === "number" ? { by, at } : null;
}

export const keyOf = (id: string): string => KEY + id;

/** Whether the user has asked for a thing. */
export function hasAsked(state: State, id: string): boolean {
  return wish(state.view.shared[keyOf(id)])?.by === state.connection.user;
}

export interface HandOver {
  /** Wishes for what the user holds, which came just now. */
  wanted: { id: string; by: string }[];
  /** What he has asked for, and can have now. */
  free: string[];
}

/** What changed between two states. */
export function handOver(state: State, before: State, present = Date.now()): HandOver {
  const found: HandOver = { wanted: [], free: [] };
  if (state.view.shared === before.view.shared && state.locks === before.locks) return found;
  const me = state.connection.user;
  for (const [key, value] of Object.entries(state.view.shared)) {
    if (!key.startsWith(KEY)) continue;
    const id = key.slice(KEY.length);
    const asked = wish(value);
    if (!asked) continue;
    if (asked.by === me) {
      if (state.locks[id] === undefined && before.locks[id] !== undefined) found.free.push(id);
    } else if (state.locks[id] === me && before.view.shared[key] !== value && present - asked.at < STALE) {
      found.wanted.push({ id, by: asked.by });
    }
  }
  return found;
}
