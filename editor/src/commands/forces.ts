/** Forcing outputs: leases that this page renews, and that end with its connection. */

import type { ForcedPoint, ForcePointArgs } from "../protocol/types";
import { call } from "../session/connection";
import { getState } from "../store/store";
import { ask } from "./requests";

/** Period of the renewals, and duration of each, ms. A page in the background may renew only once per second. */
export const RENEW = 1000;
const VALID = 5000;

declare module "../store/runtime" {
  interface Runtime {
    /** Ids of the forces of this page. */
    ownForces?: Set<string>;
  }
}

/** Force an output. Rejects with the reason if it was refused. */
export async function forcePoint(args: Omit<ForcePointArgs, "valid_ms">): Promise<void> {
  const { id } = await call("ForcePoint", { ...args, valid_ms: VALID });
  const { runtime } = getState();
  runtime.ownForces ??= new Set();
  runtime.ownForces.add(id);
}

/** Return whether this page forces an output. */
export const isOwn = (force: ForcedPoint): boolean => getState().runtime.ownForces?.has(force.id) ?? false;

/** Renew the forces of this page. */
export function renewForces(): void {
  const ids = getState()
    .forces.filter(isOwn)
    .map((each) => each.id);
  // The request is refused if one of the forces has ended. The end of the connection ends all of them.
  if (ids.length > 0) call("RenewForces", { ids, valid_ms: VALID }).catch(() => {});
}

export const endForce = (id: string) => ask("EndForce", { id });
