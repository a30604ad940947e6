/** Items that can be moved: their pose, and the request that changes it. */

import { t } from "@lingui/core/macro";
import type { ObjectModel, Pose } from "../protocol/types";
import { whyUnavailable } from "../store/permissions";
import { heldBy, isClosed, isOnline } from "../store/selectors";
import type { State } from "../store/state";
import type { Selection } from "../store/ui";
import { composed, ORIGIN, worldOf } from "../viewmodel/frames";
import type { FrameName } from "./placing";

export interface Target {
  kind: "object" | "point" | "orientation";
  id: string;
  /** The item as the server knows it. */
  of: unknown;
  /** The frame in which it is stored, and its pose in the world. */
  frame: Pose;
  pose: Pose;
  moves: boolean;
  turns: boolean;
  /** Its collision model if it can be resized, and the name of its type. */
  model?: ObjectModel;
  type?: string;
}

/** Return the selected item as a target; null if it has no pose of its own. */
export function targetOf(state: State, selection: Selection | null): Target | null {
  const { doc } = state;
  if (!doc || !selection) return null;
  const { id } = selection;
  const object = doc.objects[id];
  const draft = state.ui.draft;
  const at = (frame: Pose, known: unknown, stored: Pose) =>
    composed(frame, draft && draft.of === known ? draft.pose : stored);
  if (object) {
    if (!object.pose) return null;
    const type = state.types.byName[object.type];
    const model = type && draft?.type === type && draft.model ? draft.model : type?.object_model;
    const sized = model && !model.mesh && type && isShapeAlone(state, object.type) ? { model, type: object.type } : {};
    return {
      kind: "object",
      id,
      of: object,
      frame: ORIGIN,
      pose: at(ORIGIN, object, object.pose),
      moves: true,
      turns: true,
      ...sized,
    };
  }
  const point = doc.points[id];
  if (point) {
    const frame = worldOf(doc, point.parent);
    const pose = at(frame, point, { position: point.position, orientation: ORIGIN.orientation });
    return { kind: "point", id, of: point, frame, pose, moves: true, turns: false };
  }
  const one = doc.orientations[id];
  if (!one) return null;
  const frame = worldOf(doc, one.pointId);
  const pose = at(frame, one, { position: ORIGIN.position, orientation: one.orientation });
  return { kind: "orientation", id, of: one, frame, pose, moves: false, turns: true };
}

/** Return whether a type was created as a shape or mesh, not for a device. */
function isShapeAlone(state: State, type: string): boolean {
  for (let name: string | undefined = type, left = 10; name && left > 0; left--) {
    if (name === "CollisionObject" || name === "VirtualCollisionObject") return true;
    name = state.types.byName[name]?.base;
  }
  return false;
}

const REQUESTS = {
  object: "UpdateSceneObjectPose",
  point: "UpdateActionPointPosition",
  orientation: "UpdateActionPointOrientation",
} as const;

/** Return why it cannot be moved now, as a sentence; an empty string if it can. */
export function notMovable(state: State, { kind, id }: Pick<Target, "kind" | "id">): string {
  const { doc } = state;
  if (isClosed(state)) return t`Stop the program first.`;
  const type = doc?.objects[id]?.type ?? "";
  if (kind === "object" && type in state.types.robots && isOnline(state))
    return t`A robot cannot be moved in the scene while it is online.`;
  const holder = heldBy(state, id);
  if (holder) return t`In use by ${holder}.`;
  return whyUnavailable(state, REQUESTS[kind]);
}

/** Return why it cannot be resized now. */
export function notSizable(state: State, target: Pick<Target, "kind" | "id">): string {
  return (
    notMovable(state, target) ||
    (state.live.state !== "stopped" ? t`Go offline to change its size.` : "") ||
    whyUnavailable(state, "UpdateSceneShape")
  );
}

/** Return a frame in the world by its name; for `view` the axes of the camera. */
export function frameOf(
  state: State,
  name: FrameName,
  target: Pick<Target, "frame" | "pose">,
  robot: string,
  view: Pose,
): Pose {
  switch (name) {
    case "world":
      return ORIGIN;
    case "parent":
      return target.frame;
    case "own":
      return target.pose;
    case "robot":
      return state.doc ? worldOf(state.doc, robot) : ORIGIN;
    case "view":
      return view;
  }
}
