/** Which calls of functions can run at once, and what the branches do while they run. Pure functions. */

import { t } from "@lingui/core/macro";
import type { Action, TraceEntry } from "../protocol/types";
import { anyAction } from "../store/scope";
import type { OpenDocument, OpenFunction, State } from "../store/state";
import { calledBy } from "./operands";
import { isParallel } from "./parallel";

/** Smallest and largest number of calls that run at once. */
export const MIN_BRANCHES = 2;
export const MAX_BRANCHES = 4;

type Call = Pick<Action, "name" | "type">;

/** The devices and the parallel work that a function uses, also through the functions that it calls. */
interface Use {
  /** Names of the first action with each device, by the id of the device. */
  devices: Map<string, string>;
  /** Name of parallel work in it. */
  parallel?: string;
}

function usedBy(doc: OpenDocument, called: OpenFunction | undefined, seen: readonly string[] = []): Use {
  const use: Use = { devices: new Map() };
  if (!called || seen.includes(called.id)) return use;
  for (const action of Object.values(called.actions)) {
    const next = calledBy(doc, action);
    if (isParallel(action)) use.parallel ??= action.name;
    else if (next) {
      const inner = usedBy(doc, next, [...seen, called.id]);
      for (const [device, user] of inner.devices) if (!use.devices.has(device)) use.devices.set(device, user);
      if (inner.parallel !== undefined) use.parallel ??= inner.parallel;
    } else {
      const device = action.type.split("/")[0] ?? "";
      if (!use.devices.has(device)) use.devices.set(device, action.name);
    }
  }
  return use;
}

/** Return the devices of a function as text. */
export const devicesOf = (doc: OpenDocument, called: OpenFunction): string =>
  [...usedBy(doc, called).devices.keys()].map((id) => doc.objects[id]?.name ?? "?").join(", ");

/** Return why calls cannot run at once, as Build does; an empty string if they can. */
export function whyNotAtOnce(doc: OpenDocument, calls: readonly Call[]): string {
  const users = new Map<string, { call: Call; name: string }>();
  for (const call of calls) {
    const { devices, parallel } = usedBy(doc, calledBy(doc, call));
    if (parallel !== undefined) return t`${call.name} contains other parallel work, ${parallel}.`;
    for (const [id, name] of devices) {
      const other = users.get(id);
      const device = doc.objects[id]?.name ?? "?";
      if (other) {
        const [one, two, first] = [other.call.name, call.name, other.name];
        return t`${one} and ${two} both use ${device}: ${first} and ${name}. A device can work for one branch only.`;
      }
      users.set(id, { call, name });
    }
  }
  return "";
}

/** Return the name of the branch of parallel work that executed an action of the trace; empty for the others. */
export function laneIn(doc: OpenDocument, trace: ReadonlyMap<number, TraceEntry>, entry: TraceEntry): string {
  const bodies = [doc.program, ...Object.values(doc.functions)];
  for (let at: TraceEntry | undefined = entry; at; at = trace.get(at.call ?? -1)) {
    const id = at.action_id;
    if (bodies.some((each) => Object.values(each.actions).some(({ branches }) => branches?.includes(id))))
      return at.name;
  }
  return "";
}

/** A branch of parallel work while it runs. */
export interface Lane {
  /** Id of its call, and its id for a step. */
  id: string;
  name: string;
  /** Id and name of its present action. */
  actionId: string;
  doing: string;
}

/** Return the branches that are running at once, in the order in which the parallel action lists them. */
export function lanesOf({ doc, program }: State): Lane[] {
  if (!doc) return [];
  const found = (program.position?.branches ?? []).flatMap(({ id, frames }): Lane[] => {
    const call = anyAction(doc, id);
    const inside = frames.slice(frames.findIndex((each) => each.action_id === id) + 1);
    const actionId = frames.at(-1)?.action_id ?? id;
    if (!call) return [];
    const doing = inside.map((each) => anyAction(doc, each.action_id)?.name ?? "?").join(" › ");
    return [{ id, name: call.name, actionId, doing }];
  });
  if (found.length === 0) return [];
  const owner = Object.values(doc.program.actions)
    .concat(Object.values(doc.functions).flatMap((each) => Object.values(each.actions)))
    .find((each) => found.some(({ id }) => each.branches?.includes(id)));
  const place = (id: string) => owner?.branches?.indexOf(id) ?? 0;
  return found.sort((a, b) => place(a.id) - place(b.id));
}
