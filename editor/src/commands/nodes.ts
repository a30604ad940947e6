/** The nodes on which the objects of the open scene run. Functions that send requests return why they were refused. */

import { t } from "@lingui/core/macro";
import type { NodesData, SceneObject } from "../protocol/types";
import { call } from "../session/connection";
import type { State } from "../store/state";
import { refusal } from "./requests";
import { notBuildable } from "./scene";

/** Return which node the cell file sets for an object of this name, as a sentence; an empty string if none. */
export function setByCellFile(state: State, name: string): string {
  const assigned = state.nodes?.assigned[name];
  return assigned ? t`Set by the cell file of the server: ${assigned}.` : "";
}

/** Return why the node of an object cannot be changed now; an empty string if it can. */
export const notMovable = (state: State, object: SceneObject): string =>
  setByCellFile(state, object.name) || notBuildable(state, "SetObjectNode");

export const setNode = (id: string, node: string): Promise<string> =>
  refusal(() => call("SetObjectNode", { id, node }));

/** Return the names of the objects by the node that they name, or that the cell file sets for them. */
export function objectsByNode(nodes: NodesData | null, objects: readonly SceneObject[]): Record<string, string[]> {
  const found: Record<string, string[]> = {};
  for (const { name, node } of objects) {
    const where = nodes?.assigned[name] ?? node;
    if (where) found[where] = [...(found[where] ?? []), name];
  }
  return found;
}
