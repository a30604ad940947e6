/** Send requests from commands. A refusal is shown as a notice and reported to the caller. */

import type { CallOptions } from "../protocol/client";
import { ConnectionLost, Refused } from "../protocol/errors";
import type { Requests } from "../protocol/types";
import { call } from "../session/connection";
import { getState, notify } from "../store/store";

/** Send a request. Return undefined after notifying the user if it was refused, lost or too late. */
export async function ask<N extends keyof Requests>(
  request: N,
  args?: Requests[N]["args"],
  options?: CallOptions,
): Promise<{ data: Requests[N]["data"] } | undefined> {
  try {
    return { data: await call(request, args, options) };
  } catch (error) {
    notify(error instanceof ConnectionLost ? "warn" : "error", sentence(error));
    return undefined;
  }
}

/** Return an option for requests whose edits Undo reverts together. */
export const newStep = (): CallOptions => ({ step: Math.random().toString(36).slice(2) });

/** Return the reason why a request would be refused, an empty string if it would be accepted. Nothing is changed. */
export async function whyNot<N extends keyof Requests>(request: N, args?: Requests[N]["args"]): Promise<string> {
  try {
    await call(request, args, { dryRun: true });
    return "";
  } catch (error) {
    if (error instanceof Refused) return error.message;
    return sentence(error);
  }
}

/** Lock an item for writing, unless this page has locked it. Return the function that releases it. */
async function acquireLock(id: string, tree: boolean): Promise<() => Promise<void>> {
  const key = tree ? `${id}/tree` : id;
  const { locks } = getState().runtime;
  const lock = locks.get(key) ?? { users: 0, granted: call("WriteLock", { object_id: id, lock_tree: tree }) };
  locks.set(key, lock);
  lock.users++;
  const last = () => {
    lock.users--;
    if (lock.users > 0) return false;
    if (locks.get(key) === lock) locks.delete(key);
    return true;
  };
  try {
    await lock.granted;
  } catch (error) {
    last();
    throw error;
  }
  return async () => {
    // Some requests release the lock themselves.
    if (last()) await call("WriteUnlock", { object_id: id }).catch(() => {});
  };
}

/** Do something while holding the write lock of an item, and release it afterwards. */
export async function withLockOrNotify<T>(
  id: string,
  work: () => Promise<T | undefined>,
  tree = false,
): Promise<T | undefined> {
  let releaseLock: () => Promise<void>;
  try {
    releaseLock = await acquireLock(id, tree);
  } catch (error) {
    notify(error instanceof ConnectionLost ? "warn" : "error", sentence(error));
    return undefined;
  }
  try {
    return await work();
  } finally {
    await releaseLock();
  }
}

/** Run an operation for a form. Return the reason of a refusal, to be shown in the form; an empty string on success. */
export async function refusal(work: () => Promise<unknown>): Promise<string> {
  try {
    await work();
    return "";
  } catch (error) {
    return sentence(error);
  }
}

/** Like `withLockOrNotify`, but reject with the refusal instead of notifying the user: for `refusal`. */
export async function withLock<T>(id: string, work: () => Promise<T>, tree = false): Promise<T> {
  const releaseLock = await acquireLock(id, tree);
  try {
    return await work();
  } finally {
    await releaseLock();
  }
}

export function sentence(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
