/**
 * Requests for items that another user has locked. The protocol has no such request: our clients store it in the shared
 * view state of the document, as `asked/<id>`, until the item is released. Other clients ignore it.
 */

import type { State } from "./state";

const KEY = "asked/";
/** Time after which a request is no longer announced, ms. */
const STALE = 10 * 60_000;

interface ItemRequest {
  by: string;
  /** Clock time of the requesting client, ms since 1970. */
  at: number;
}

function itemRequest(value: unknown): ItemRequest | null {
  const { by, at } = (value ?? {}) as Record<string, unknown>;
  return typeof by === "string" && typeof at === "number" ? { by, at } : null;
}

export const requestKey = (id: string): string => KEY + id;

/** Return whether the user has requested an item. */
export function hasRequested(state: State, id: string): boolean {
  return itemRequest(state.view.shared[requestKey(id)])?.by === state.connection.user;
}

interface HandOver {
  /** New requests for items that the user holds. */
  wanted: { id: string; by: string }[];
  /** Items that the user requested and that are released now. */
  free: string[];
}

/** Return the differences between two states. */
export function handOver(state: State, before: State, present = Date.now()): HandOver {
  const found: HandOver = { wanted: [], free: [] };
  if (state.view.shared === before.view.shared && state.locks === before.locks) return found;
  const me = state.connection.user;
  for (const [key, value] of Object.entries(state.view.shared)) {
    if (!key.startsWith(KEY)) continue;
    const id = key.slice(KEY.length);
    const asked = itemRequest(value);
    if (!asked) continue;
    if (asked.by === me) {
      if (state.locks[id] === undefined && before.locks[id] !== undefined) found.free.push(id);
    } else if (state.locks[id] === me && before.view.shared[key] !== value && present - asked.at < STALE) {
      found.wanted.push({ id, by: asked.by });
    }
  }
  return found;
}
