/** The orientation of the device, which replaces the markers for a moment while none is visible. */

import { apply, type Mat3, multiply, rotation, scale, transposed } from "./geometry";
import { eyeOf, type View } from "./pose";

const DEGREE = Math.PI / 180;

/**
 * Return the orientation of the camera at the back of a device: a rotation from the camera frame (x right, y down, z
 * forward) to the frame of the orientation sensor.
 *
 * @param alpha, beta, gamma angles of a `deviceorientation` event, degrees.
 * @param screen angle of the screen, degrees.
 */
export function cameraOrientation(alpha: number, beta: number, gamma: number, screen: number): Mat3 {
  const device = multiply(
    multiply(rotation([0, 0, alpha * DEGREE]), rotation([beta * DEGREE, 0, 0])),
    rotation([0, gamma * DEGREE, 0]),
  );
  const upright = multiply(device, rotation([0, 0, -screen * DEGREE]));
  return multiply(upright, [
    [1, 0, 0],
    [0, -1, 0],
    [0, 0, -1],
  ]);
}

/** Return a view after the camera turned on the spot. */
export function turnedView(view: View, before: Mat3, after: Mat3): View {
  const turn = multiply(multiply(transposed(after), before), view.turn);
  return { turn, shift: scale(apply(turn, eyeOf(view)), -1) };
}

export class Gyro {
  private latest: Mat3 | null = null;
  private readonly forget = new AbortController();

  constructor() {
    window.addEventListener(
      "deviceorientation",
      ({ alpha, beta, gamma }) => {
        if (alpha === null || beta === null || gamma === null) return;
        this.latest = cameraOrientation(alpha, beta, gamma, screen.orientation?.angle ?? 0);
      },
      { signal: this.forget.signal },
    );
  }

  /** The current orientation of the camera; null on devices without a sensor. */
  get camera(): Mat3 | null {
    return this.latest;
  }

  stop(): void {
    this.forget.abort();
  }
}
