/** Conversion of protocol poses to three.js. */

import { type Object3D, Quaternion, Vector3 } from "three";
import type { Orientation, Pose, Position } from "../protocol/types";

export function setPose(of: Object3D, pose: Pose): void {
  setPosition(of, pose.position);
  setOrientation(of, pose.orientation);
}

export function setPosition(of: Object3D, { x, y, z }: Position): void {
  of.position.set(x, y, z);
}

export function setOrientation(of: Object3D, { x, y, z, w }: Orientation): void {
  of.quaternion.set(x, y, z, w).normalize();
}

/** Return the pose of an object in the world. */
export function worldPose(of: Object3D): Pose {
  const p = of.getWorldPosition(new Vector3());
  const q = of.getWorldQuaternion(new Quaternion());
  return { position: { x: p.x, y: p.y, z: p.z }, orientation: { x: q.x, y: q.y, z: q.z, w: q.w } };
}
