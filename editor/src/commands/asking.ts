/** How commands ask: a refusal becomes a notice with the server's sentence, and the caller learns that it failed. */

import type { CallOptions } from "../protocol/client";
import { ConnectionLost, Refused } from "../protocol/errors";
import type { Requests } from "../protocol/types";
import { call } from "../session/connection";
import { tell } from "../store/store";

/** Ask; gives undefined after telling the user when it was refused, lost or too late. */
export async function ask<N extends keyof Requests>(
  request: N,
  args?: Requests[N]["args"],
  options?: CallOptions,
): Promise<{ data: Requests[N]["data"] } | undefined> {
  try {
    return { data: await call(request, args, options) };
  } catch (error) {
    tell(error instanceof ConnectionLost ? "warn" : "error", sentence(error));
    return undefined;
  }
}

/** Give why a request would be refused, empty when it would be granted; nothing is changed. */
export async function whyNot<N extends keyof Requests>(request: N, args?: Requests[N]["args"]): Promise<string> {
  try {
    await call(request, args, { dryRun: true });
    return "";
  } catch (error) {
    if (error instanceof Refused) return error.message;
    return sentence(error);
  }
}

/** What this tablet has locked, and for how many at once: the last one gives the lock back. */
const locked = new Map<string, { times: number; taken: Promise<unknown> }>();

/** Take an item's write lock, unless this tablet has it already; gives what gives it back. Rejects when it is refused. */
async function take(id: string, tree: boolean): Promise<() => Promise<void>> {
  const key = tree ? `${id}/tree` : id;
  const mine = locked.get(key) ?? { times: 0, taken: call("WriteLock", { object_id: id, lock_tree: tree }) };
  locked.set(key, mine);
  mine.times++;
  const last = () => {
    mine.times--;
    if (mine.times > 0) return false;
    if (locked.get(key) === mine) locked.delete(key);
    return true;
  };
  try {
    await mine.taken;
  } catch (error) {
    last();
    throw error;
  }
  return async () => {
    // Some requests unlock by themselves: then there is nothing to give back.
    if (last()) await call("WriteUnlock", { object_id: id }).catch(() => {});
  };
}

/** Do something while holding an item's write lock, which is given back in any case unless the request does that. */
export async function holding<T>(id: string, work: () => Promise<T | undefined>, tree = false): Promise<T | undefined> {
  let giveBack: () => Promise<void>;
  try {
    giveBack = await take(id, tree);
  } catch (error) {
    tell(error instanceof ConnectionLost ? "warn" : "error", sentence(error));
    return undefined;
  }
  try {
    return await work();
  } finally {
    await giveBack();
  }
}

/** Do something for a form: gives why it was refused, to be shown where it happened; empty when it was done. */
export async function refusal(work: () => Promise<unknown>): Promise<string> {
  try {
    await work();
    return "";
  } catch (error) {
    return sentence(error);
  }
}

/** As `holding`, but rejects with what was refused instead of telling it: for `refusal`. */
export async function held<T>(id: string, work: () => Promise<T>, tree = false): Promise<T> {
  const giveBack = await take(id, tree);
  try {
    return await work();
  } finally {
    await giveBack();
  }
}

export function sentence(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
