/** Report the pose of the camera for other users: at most twice a second, and only changes. */

import { Matrix4, Quaternion } from "three";
import type { Pose } from "../protocol/types";
import { norm, sub, type Vec3 } from "./geometry";
import { eyeOf, type View } from "./pose";

/** Time between two reports, ms. */
export const PERIOD = 500;
/** Smallest reported shift, m, and turn, rad. */
const SHIFT = 0.01;
const TURN = 0.02;

export class CameraReporter {
  private last: { view: View; at: number } | null = null;

  constructor(private readonly report: (camera: Pose | null) => void) {}

  /** Report the view of a picture if it is due; null while it is unknown. `now`: time, ms. */
  take(view: View | null, now: number): void {
    const { last } = this;
    if (!view && !last) return;
    if (view && last && (now - last.at < PERIOD || !differ(last.view, view))) return;
    this.last = view && { view, at: now };
    this.report(view && poseOf(view));
  }
}

function differ(a: View, b: View): boolean {
  const turns = a.turn.map((row, i) => norm(sub(row, b.turn[i] as Vec3)));
  return norm(sub(eyeOf(a), eyeOf(b))) > SHIFT || Math.max(...turns) > TURN;
}

/** Return the pose of the optical frame of the camera (x right, y down, z forward) in the workplace. */
function poseOf(view: View): Pose {
  const [[a, b, c], [d, e, f], [g, h, i]] = view.turn;
  const [x, y, z] = eyeOf(view);
  const turn = new Quaternion().setFromRotationMatrix(
    new Matrix4().set(a, d, g, 0, b, e, h, 0, c, f, i, 0, 0, 0, 0, 1),
  );
  return { position: { x, y, z }, orientation: { x: turn.x, y: turn.y, z: turn.z, w: turn.w } };
}
