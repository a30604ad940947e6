/** Read what the view shows of an item, for tests and for tools that draw on top of the view. */

import { type PerspectiveCamera, Vector3 } from "three";
import type { Pose } from "../protocol/types";
import type { Telemetry } from "../store/telemetry";
import type { Item } from "./items";
import { worldPose } from "./poses";
import { type Thing, trianglesOf } from "./thing";
import { RobotThing } from "./things/robot";

/** An item as the view shows it. */
export interface Probe {
  kind: Item["kind"];
  name: string;
  pose: Pose;
  /** Position of its label, pixels from the upper left corner of the view; null behind the camera. */
  screen: { x: number; y: number } | null;
  visible: boolean;
  /** Transparency from 0, opaque, to 1, invisible. */
  faint: number;
  badge: string;
  /** Meaning of the symbol drawn on it. */
  sign: string;
  /** The reason why its model is not shown; empty if it is shown. */
  problem: string;
  /** Triangles of its model without the ghost; 0 if it is drawn as an instance. */
  triangles: number;
  joints?: Record<string, number>;
  ghost?: Record<string, number> | null;
  endEffectors?: Pose[];
}

/** Return what the view shows of an item. Frames have to be up to date. */
export function probe(
  thing: Thing,
  telemetry: Telemetry,
  camera: PerspectiveCamera,
  size: { width: number; height: number },
): Probe {
  camera.updateMatrixWorld();
  const at = thing.anchor(new Vector3()).project(camera);
  const result: Probe = {
    kind: thing.item.kind,
    name: thing.item.name,
    pose: worldPose(thing.root),
    screen: at.z > 1 ? null : { x: ((at.x + 1) / 2) * size.width, y: ((1 - at.y) / 2) * size.height },
    visible: thing.root.visible && at.z <= 1 && Math.abs(at.x) <= 1 && Math.abs(at.y) <= 1,
    faint: thing.item.faint,
    badge: thing.badge(),
    sign: thing.sign,
    problem: thing.problem,
    triangles: trianglesOf(thing.root, thing.item.id),
  };
  if (thing instanceof RobotThing) {
    result.joints = Object.fromEntries(
      Object.entries(thing.robot?.joints ?? {}).map(([name, joint]) => [name, Number(joint.angle)]),
    );
    result.ghost = thing.ghostJoints();
    result.endEffectors = telemetry.endEffectors(thing.item.id).map((each) => each.pose);
  }
  return result;
}
