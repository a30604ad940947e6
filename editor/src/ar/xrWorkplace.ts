/** The pose of the workplace in an XR session. Between registrations, an anchor tracks it. */

import { Matrix4, Quaternion, Vector3 } from "three";
import type { Vec3 } from "./geometry";
import { type Movement, movedView } from "./placing";
import { JUMP, jumpBetween } from "./registration";
import { inverseOf, matrixOf, viewOf, workplaceIn } from "./xrView";

/** Drift that is expected of the device's tracking, relative to the distance that it moved. */
const DRIFT = 0.01;
/** Part of a measured correction that is used at once, if it is small. */
const BLEND = 0.3;
/** Place of the floor without a surface, relative to the device, m. */
const FLOOR = new Vector3(0, -1.2, -1);

export type Source = "markers" | "touch" | "hand";

export class XrWorkplace {
  /** Its pose in the frame of WebXR; null while it is unknown. */
  pose: Matrix4 | null = null;
  source: Source | null = null;
  /** Time of the registration, ms. */
  at = 0;
  private stated = 0;
  private walked = 0;
  private from: Vector3 | null = null;
  private anchor: { of: XRAnchor; pose: Matrix4; workplace: Matrix4 } | null = null;
  private wantsAnchor = false;

  /** Points at which a correction is measured, m. */
  constructor(private readonly middles: readonly Vec3[]) {}

  /** Expected error with the drift since the registration, m. */
  get error(): number {
    return this.source ? Math.hypot(this.stated, DRIFT * this.walked) : Number.POSITIVE_INFINITY;
  }

  /** Whether the expected drift is visible. */
  get drifted(): boolean {
    return DRIFT * this.walked > JUMP;
  }

  /** Take the poses of the device and of the anchor in a frame. */
  follow(frame: XRFrame, space: XRReferenceSpace, viewer: Matrix4): void {
    const at = new Vector3().setFromMatrixPosition(viewer);
    this.walked += this.from ? at.distanceTo(this.from) : 0;
    this.from = at;
    const { anchor } = this;
    const held = anchor && frame.getPose(anchor.of.anchorSpace, space);
    if (held && this.pose) {
      anchor.pose = matrixOf(held.transform.matrix);
      this.pose = anchor.pose.clone().multiply(anchor.workplace);
    }
    if (this.wantsAnchor) this.createAnchor(frame, space);
  }

  /**
   * Take a measured pose: a small correction gradually, a large one at once. Return how far it moved the overlay, m; 0
   * if it was not visible.
   */
  register(pose: Matrix4, source: Source, error: number, camera: Matrix4): number {
    const before = this.pose;
    const jump = before ? jumpBetween(viewOf(before, camera), viewOf(pose, camera), this.middles) : 0;
    // A rough sighting does not replace a better registration, unless they contradict each other clearly.
    if (source === "markers" && this.source === "markers" && error > 2 * this.error && jump < 3 * error) return 0;
    const gradually = before && source === "markers" && this.source === "markers" && jump <= JUMP;
    this.set(gradually ? blended(before, pose, BLEND) : pose);
    this.source = source;
    this.stated = error;
    this.at = performance.now();
    this.walked = 0;
    return jump > JUMP ? jump : 0;
  }

  /** Put it upright on a surface, or in front of the device on the floor; its y axis points away from the user. */
  place(surface: Matrix4 | null, viewer: Matrix4): void {
    const eye = new Vector3().setFromMatrixPosition(viewer);
    const ahead = new Vector3(0, 0, -1).transformDirection(viewer);
    const heading = Math.atan2(-ahead.x, -ahead.z);
    const up = new Vector3(0, 1, 0);
    const at = surface
      ? new Vector3().setFromMatrixPosition(surface)
      : FLOOR.clone().applyAxisAngle(up, heading).add(eye);
    const turn = new Quaternion().setFromAxisAngle(up, heading);
    turn.multiply(new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), -Math.PI / 2));
    this.register(new Matrix4().compose(at, turn, new Vector3(1, 1, 1)), "hand", 0, viewer);
  }

  /** Move the workplace by a movement in its own frame. */
  move(by: Movement, camera: Matrix4): void {
    if (this.pose) this.set(workplaceIn(movedView(viewOf(this.pose, camera), by), camera));
  }

  forget(): void {
    this.anchor?.of.delete();
    this.anchor = null;
    this.pose = null;
    this.source = null;
    this.wantsAnchor = false;
  }

  /** The frame of WebXR was reset: without an anchor, the pose is lost. Return whether it is. */
  reset(): boolean {
    if (!this.anchor) this.forget();
    return !this.anchor;
  }

  private set(pose: Matrix4): void {
    this.pose = pose;
    if (this.anchor) this.anchor.workplace = inverseOf(this.anchor.pose).multiply(pose);
    else this.wantsAnchor = true;
  }

  /** Create an anchor, with which the device tracks the workplace, if it supports anchors. */
  private createAnchor(frame: XRFrame, space: XRReferenceSpace): void {
    this.wantsAnchor = false;
    const { pose } = this;
    if (!pose || !frame.createAnchor) return;
    const { x, y, z } = new Vector3().setFromMatrixPosition(pose);
    const at = new XRRigidTransform({ x, y, z });
    frame
      .createAnchor(at, space)
      ?.then((of) => {
        if (!this.pose || this.anchor) return of.delete();
        const made = matrixOf(at.matrix);
        this.anchor = { of, pose: made, workplace: inverseOf(made).multiply(this.pose) };
      })
      .catch(() => {}); // without an anchor, the pose is fixed in the frame of the session
  }
}

/** Return a pose between two. */
function blended(from: Matrix4, to: Matrix4, part: number): Matrix4 {
  const parts = (each: Matrix4) => {
    const [at, turn] = [new Vector3(), new Quaternion()];
    each.decompose(at, turn, new Vector3());
    return { at, turn };
  };
  const [a, b] = [parts(from), parts(to)];
  return new Matrix4().compose(a.at.lerp(b.at, part), a.turn.slerp(b.turn, part), new Vector3(1, 1, 1));
}
