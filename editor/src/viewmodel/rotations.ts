/** Rotations as roll, pitch and yaw. */

import type { Orientation } from "../protocol/types";

const DEGREES = 180 / Math.PI;

/** Return roll, pitch and yaw in degrees: about the fixed axes x, y and z, in this order. */
export function rollPitchYaw({ x, y, z, w }: Orientation): [number, number, number] {
  const sine = Math.min(1, Math.max(-1, 2 * (w * y - z * x)));
  if (Math.abs(sine) > 0.999_999) {
    // Gimbal lock: roll and yaw have the same axis, so everything is yaw.
    return [0, Math.sign(sine) * 90, -Math.sign(sine) * 2 * Math.atan2(x, w) * DEGREES];
  }
  return [
    Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)) * DEGREES,
    Math.asin(sine) * DEGREES,
    Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) * DEGREES,
  ];
}
