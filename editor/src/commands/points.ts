/** Action points, orientations and joints. Functions return why they were refused, or an empty string. */

import { t } from "@lingui/core/macro";
import { freeName } from "../program/naming";
import type { Joint, Orientation, Position } from "../protocol/types";
import { call } from "../session/connection";
import type { State } from "../store/state";
import { getState, select } from "../store/store";
import { relativeTo, worldOf } from "../viewmodel/frames";
import { awaited } from "./ownEvents";
import { newStep, refusal, withLock } from "./requests";
import { type RobotSelection, robotArg } from "./robot";

const names = (of: Record<string, { name: string }> | undefined) => Object.values(of ?? {}).map((each) => each.name);

/** Return the names of the items at a point. */
const namesAt = <T extends { name: string; pointId: string }>(of: Record<string, T> | undefined, point: string) =>
  Object.values(of ?? {})
    .filter((each) => each.pointId === point)
    .map((each) => each.name);

const pointNamed = (name: string) =>
  awaited((state) => Object.values(state.doc?.points ?? {}).find((each) => each.name === name)).catch(() => undefined);

// ------------------------------------------------------------------------------------------------ points
/** Add a point at a position in the world, with an optional parent, and select it. */
export function addPoint(world: Position, parent = "", orientation?: Orientation): Promise<string> {
  return refusal(async () => {
    const { doc } = getState();
    if (!doc) return;
    const name = freeName("point", names(doc.points));
    const frame = worldOf(doc, parent);
    const { position } = relativeTo(frame, { position: world, orientation: { x: 0, y: 0, z: 0, w: 1 } });
    const step = newStep();
    await call("AddActionPoint", { name, position, ...(parent ? { parent } : {}) }, step);
    const point = await pointNamed(name);
    if (!point) return;
    select({ kind: "point", id: point.id });
    if (orientation) {
      const turned = relativeTo(frame, { position: world, orientation }).orientation;
      await withLock(point.id, () =>
        call("AddActionPointOrientation", { action_point_id: point.id, orientation: turned, name: "default" }, step),
      );
    }
  });
}

/** Save the robot pose as a point with orientation and joints, and select it. */
export const addPointFromRobot = (chosen: RobotSelection): Promise<string> =>
  refusal(async () => {
    const point = await pointNamed(await teachPoint(chosen));
    if (point) select({ kind: "point", id: point.id });
  });

/** Save the robot pose as a point with orientation and joints. Return its name. */
export async function teachPoint({ robotId, armId, effector }: RobotSelection): Promise<string> {
  const name = freeName("point", names(getState().doc?.points));
  await call("AddApUsingRobot", {
    robot_id: robotId,
    end_effector_id: effector,
    name,
    ...(armId ? { arm_id: armId } : {}),
  });
  return name;
}

export const movePointToRobot = (id: string, chosen: RobotSelection) =>
  refusal(() =>
    withLock(id, () => call("UpdateActionPointUsingRobot", { action_point_id: id, robot: robotArg(chosen) }), true),
  );

/** Change the parent of a point; its position in the world stays the same. */
export const setParent = (id: string, parent: string) =>
  refusal(() => withLock(id, () => call("UpdateActionPointParent", { action_point_id: id, new_parent_id: parent })));

/** Return the possible parents of a point: items with a pose, except its own descendants. */
export function possibleParents(state: State, id: string): string[] {
  const { doc } = state;
  if (!doc) return [];
  const below = (each: string | undefined): boolean =>
    each !== undefined && (each === id || below(doc.points[each]?.parent));
  const objects = Object.values(doc.objects).filter((each) => each.pose);
  const points = Object.values(doc.points).filter((each) => !below(each.id));
  return [...objects, ...points].map((each) => each.id);
}

/** Copy a point and its children `count` times, each one step further, in the frame of the parent. */
export function copyPoint(id: string, count: number, step: Position): Promise<string> {
  return refusal(async () => {
    const from = getState().doc?.points[id]?.position;
    if (!from) return;
    const together = newStep();
    for (let number = 1; number <= count; number++) {
      const position = { x: from.x + step.x * number, y: from.y + step.y * number, z: from.z + step.z * number };
      await call("CopyActionPoint", { id, position }, { ...together, deadline: 30 });
    }
  });
}

/** Copy a point and its children to the other side of the origin of the parent, along an axis. Orientations stay. */
export function mirrorPoint(id: string, axis: keyof Position): Promise<string> {
  return refusal(async () => {
    const from = getState().doc?.points[id]?.position;
    if (from) await call("CopyActionPoint", { id, position: { ...from, [axis]: -from[axis] } }, newStep());
  });
}

export const removePoint = (id: string) => refusal(() => call("RemoveActionPoint", { id }));
export const renamePoint = (id: string, new_name: string) =>
  refusal(() => withLock(id, () => call("RenameActionPoint", { action_point_id: id, new_name })));

// ------------------------------------------------------------------------------------------------ orientations
export function addOrientation(point: string, orientation: Orientation, stem = "orientation"): Promise<string> {
  const name = freeName(stem, namesAt(getState().doc?.orientations, point));
  return refusal(() =>
    withLock(point, () => call("AddActionPointOrientation", { action_point_id: point, orientation, name })),
  );
}

export function addOrientationFromRobot(point: string, chosen: RobotSelection): Promise<string> {
  const name = freeName("orientation", namesAt(getState().doc?.orientations, point));
  return refusal(() =>
    withLock(point, () =>
      call("AddActionPointOrientationUsingRobot", { action_point_id: point, robot: robotArg(chosen), name }),
    ),
  );
}

export const turnOrientation = (id: string, orientation: Orientation) =>
  refusal(() => withLock(id, () => call("UpdateActionPointOrientation", { orientation_id: id, orientation })));
export const turnOrientationToRobot = (id: string, chosen: RobotSelection) =>
  refusal(() =>
    withLock(id, () => call("UpdateActionPointOrientationUsingRobot", { orientation_id: id, robot: robotArg(chosen) })),
  );
export const renameOrientation = (id: string, new_name: string) =>
  refusal(() => withLock(id, () => call("RenameActionPointOrientation", { orientation_id: id, new_name })));
export const removeOrientation = (id: string) =>
  refusal(() => call("RemoveActionPointOrientation", { orientation_id: id }));

// ------------------------------------------------------------------------------------------------ joints
/** Return the point of a joint configuration, which has to be locked to edit it. */
const pointOf = (joints: string): string => getState().doc?.joints[joints]?.pointId ?? "";

export function addJointsFromRobot(point: string, { robotId, armId, effector }: RobotSelection): Promise<string> {
  const name = freeName("joints", namesAt(getState().doc?.joints, point));
  const args = {
    action_point_id: point,
    robot_id: robotId,
    name,
    end_effector_id: effector,
    ...(armId ? { arm_id: armId } : {}),
  };
  return refusal(() => withLock(point, () => call("AddActionPointJointsUsingRobot", args)));
}

export const setJoints = (id: string, joints: Joint[]) =>
  refusal(() => withLock(pointOf(id), () => call("UpdateActionPointJoints", { joints_id: id, joints })));
export const setJointsToRobot = (id: string) =>
  refusal(() => withLock(pointOf(id), () => call("UpdateActionPointJointsUsingRobot", { joints_id: id })));
export const renameJoints = (id: string, new_name: string) =>
  refusal(() => withLock(pointOf(id), () => call("RenameActionPointJoints", { joints_id: id, new_name })));
export const removeJoints = (id: string) =>
  refusal(() => withLock(pointOf(id), () => call("RemoveActionPointJoints", { joints_id: id })));

/**
 * Recompute the joints for an orientation of their point, close to the previous ones, so that the arm keeps its
 * posture.
 */
export function solveJoints(id: string, orientationId: string): Promise<string> {
  return refusal(async () => {
    const { doc, live } = getState();
    const stored = doc?.joints[id];
    if (!doc || !stored) return;
    const effector =
      stored.end_effector_id ??
      live.arms[stored.robot_id]?.find((each) => each.id === (stored.arm_id ?? ""))?.effectors[0];
    if (effector === undefined) throw new Error(t`Go online first. The end effectors are unknown offline.`);
    const joints = await call("InverseKinematics", {
      robot_id: stored.robot_id,
      end_effector_id: effector,
      pose: worldOf(doc, orientationId),
      start_joints: stored.joints,
      ...(stored.arm_id ? { arm_id: stored.arm_id } : {}),
    });
    await withLock(stored.pointId, () => call("UpdateActionPointJoints", { joints_id: id, joints }));
  });
}
