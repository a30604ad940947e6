/** Interlocks of the open scene. Functions return why they were refused. */

import { t } from "@lingui/core/macro";
import type { Interlock, Need, ObjectTypeMeta, ObservationMeta } from "../protocol/types";
import { call } from "../session/connection";
import { whyUnavailable } from "../store/permissions";
import type { State } from "../store/state";
import { refusal } from "./requests";

/** Return why interlocks cannot be changed now; an empty string if they can. */
export function notChangeable(state: State): string {
  return state.doc ? whyUnavailable(state, "PutInterlock") : t`No scene or project is open.`;
}

export const putInterlock = (interlock: Interlock): Promise<string> =>
  refusal(() => call("PutInterlock", { interlock }));

export const deleteInterlock = (id: string): Promise<string> => refusal(() => call("DeleteInterlock", { id }));

/** Return whether an object is a body without a device, so that it can be a zone. */
export function canBeZone(type: ObjectTypeMeta | undefined): boolean {
  return (
    type?.base === "VirtualCollisionObject" && ["Box", "Cylinder", "Sphere"].includes(type?.object_model?.type ?? "")
  );
}

/** Return a condition for an observation, with a value that users probably want. */
export function needFor(objectId: string, observation: ObservationMeta | undefined, point = ""): Need {
  const need = { object_id: objectId, observation: observation?.name ?? "", operator: "==" as const, point };
  if (observation?.members) return { ...need, value: observation.members[0] ?? '""' };
  if (isNumber(observation)) return { ...need, operator: "<=", value: "0" };
  return { ...need, value: observation?.type === "string" ? '""' : "true" };
}

export const isNumber = (observation: ObservationMeta | undefined): boolean =>
  observation?.type === "double" || observation?.type === "integer";

/** Return a name that no other interlock has. */
export function freeInterlockName(base: string, interlocks: readonly Interlock[]): string {
  const taken = new Set(interlocks.map((each) => each.name));
  let name = base;
  for (let n = 2; taken.has(name); n++) name = `${base} ${n}`;
  return name;
}
