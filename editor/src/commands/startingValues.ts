/** Values for the parameters of new actions, and the values that devices offer. */

import { t } from "@lingui/core/macro";
import { compareTexts } from "../formats";
import { needsPlace } from "../program/chain";
import { decoded } from "../program/json";
import { calledBy, metaOf, PASSED_ON } from "../program/logic";
import { freeName } from "../program/naming";
import { initialValue } from "../program/values";
import type { CallOptions } from "../protocol/client";
import type { ActionParameter, ObjectAction, Orientation, Position } from "../protocol/types";
import { call } from "../session/connection";
import { put } from "../store/records";
import type { State } from "../store/state";
import { getState, store } from "../store/store";
import { awaited } from "./ownEvents";
import { withLock } from "./requests";

/** The place for a new action: a point, or a position in the world, where a point is added. */
export type Where = { pointId: string; orientationId?: string } | { position: Position; orientation: Orientation };

/** The tool points down, which suits a gripper above a table. */
export const DOWN: Orientation = { x: 1, y: 0, z: 0, w: 0 };

async function orientationOf(pointId: string, where: Where, step: CallOptions): Promise<string> {
  if ("pointId" in where && where.orientationId) return where.orientationId;
  const on = (state: State) =>
    Object.values(state.doc?.orientations ?? {}).find((each) => each.pointId === pointId)?.id;
  const there = on(getState());
  if (there) return there;
  const orientation = "orientation" in where ? where.orientation : DOWN;
  await withLock(pointId, () =>
    call("AddActionPointOrientation", { action_point_id: pointId, orientation, name: "default" }, step),
  );
  return awaited(on);
}

/** Return joints of a robot at a point; they are read from the robot if there are none. */
async function jointsOf(pointId: string, robotId: string, step: CallOptions): Promise<string> {
  const on = (state: State) =>
    Object.values(state.doc?.joints ?? {}).find((each) => each.pointId === pointId && each.robot_id === robotId)?.id;
  const there = on(getState());
  if (there) return there;
  const taken = Object.values(getState().doc?.joints ?? {})
    .filter((each) => each.pointId === pointId)
    .map((each) => each.name);
  const name = freeName("default", taken);
  await withLock(pointId, () =>
    call("AddActionPointJointsUsingRobot", { action_point_id: pointId, robot_id: robotId, name }, step),
  );
  return awaited(on);
}

/** Return values for the parameters of a new action. */
export async function startingParameters(
  objectId: string,
  meta: ObjectAction,
  pointId: string,
  where: Where,
  step: CallOptions,
): Promise<ActionParameter[]> {
  const parameters: ActionParameter[] = [];
  for (const wanted of meta.parameters) {
    const { name, type } = wanted;
    const known = lastGiven(objectId, name);
    if (known) {
      parameters.push(known);
      continue;
    }
    const value =
      type === "pose"
        ? JSON.stringify(await orientationOf(pointId, where, step))
        : type === "joints"
          ? JSON.stringify(await jointsOf(pointId, robotFor(objectId, name), step))
          : type === "position"
            ? JSON.stringify(pointId)
            : await startingValue(objectId, wanted);
    if (value === undefined) {
      const other = resultLinkFor(type);
      if (!other) throw new Error(t`${name} is the result of another action. Add that action first.`);
      parameters.push({ name, type: "link", value: JSON.stringify(other) });
    } else parameters.push({ name, type, value });
  }
  return parameters;
}

/** Return the value of a parameter in another call of the function, unless only that call can use it. */
function lastGiven(functionId: string, name: string): ActionParameter | undefined {
  const { doc } = getState();
  if (!doc?.functions[functionId]) return undefined;
  const given = [doc.program, ...Object.values(doc.functions)]
    .flatMap(({ actions }) => Object.values(actions))
    .filter((each) => calledBy(doc, each)?.id === functionId)
    .flatMap((each) => each.parameters.filter((one) => one.name === name));
  return given.findLast(({ type }) => type !== "link" && type !== PASSED_ON);
}

/** Return the robot whose joints a parameter takes: that of the first action of the function that uses it. */
function robotFor(objectId: string, name: string): string {
  const { doc } = getState();
  for (const action of Object.values(doc?.functions[objectId]?.actions ?? {})) {
    const use = action.parameters.find((each) => each.type === PASSED_ON && decoded(each.value) === name);
    if (use) return robotFor(action.type.split("/")[0] ?? "", use.name);
  }
  return objectId;
}

/** Return whether a new action needs a place: a further call of a function uses those of the other calls. */
export const takesPlace = (objectId: string, meta: ObjectAction): boolean =>
  needsPlace({ ...meta, parameters: meta.parameters.filter((each) => !lastGiven(objectId, each.name)) });

async function startingValue(
  objectId: string,
  wanted: ObjectAction["parameters"][number],
): Promise<string | undefined> {
  if (wanted.dynamic_value && wanted.default_value === undefined && wanted.type === "string") {
    const values = await dynamicValues(objectId, wanted.name, []).catch(() => null);
    if (values?.[0] !== undefined) return JSON.stringify(values[0]);
  }
  return initialValue(wanted);
}

/** Return a link to a stored result of a type; undefined if there is none. */
function resultLinkFor(type: string): string | undefined {
  const { doc, types } = getState();
  for (const action of Object.values(doc?.actions ?? {})) {
    const index = (doc && metaOf(types, doc, action)?.returns.indexOf(type)) ?? -1;
    if (index >= 0 && action.flows[0]?.outputs[index]) return `${action.id}/default/${index}`;
  }
  return undefined;
}

const dynamicKey = (objectId: string, name: string, parents: { id: string; value: string }[]) =>
  JSON.stringify([objectId, name, parents]);

export function lastDynamicValues(
  objectId: string,
  name: string,
  parents: { id: string; value: string }[],
): string[] | undefined {
  return getState().dynamicValues[dynamicKey(objectId, name, parents)];
}

/** Return the possible values of a parameter according to the device. Reject if it cannot be reached. */
export async function dynamicValues(
  objectId: string,
  name: string,
  parents: { id: string; value: string }[],
): Promise<string[]> {
  const found = await call("ActionParamValues", { id: objectId, param_id: name, parent_params: parents });
  const values = [...found].sort((a, b) => compareTexts(a, b));
  store.setState((state) => ({ dynamicValues: put(state.dynamicValues, dynamicKey(objectId, name, parents), values) }));
  return values;
}
