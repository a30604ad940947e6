import { expect, test } from "vitest";
import { apply, type Mat3, transposed, type Vec3 } from "./geometry";
import { cameraOrientation, turnedView } from "./gyro";
import { eyeOf } from "./pose";
import { looking } from "./testing";

const forward = (orientation: Mat3): Vec3 => apply(orientation, [0, 0, 1]);
const right = (orientation: Mat3): Vec3 => apply(orientation, [1, 0, 0]);
const close = (found: Vec3, expected: Vec3) => found.forEach((value, i) => expect(value).toBeCloseTo(expected[i] ?? 0));

test("a flat device looks down, an upright one to the horizon", () => {
  close(forward(cameraOrientation(0, 0, 0, 0)), [0, 0, -1]);
  close(forward(cameraOrientation(0, 90, 0, 0)), [0, 1, 0]);
  close(forward(cameraOrientation(90, 90, 0, 0)), [-1, 0, 0]);
  close(right(cameraOrientation(0, 90, 0, 0)), [1, 0, 0]);
});

test("in landscape, the picture is upright too", () => {
  // The left side of the device is at the bottom: it is turned counter-clockwise, and the screen is turned back.
  const landscape = cameraOrientation(0, 0, -90, 90);
  expect(apply(landscape, [0, 1, 0])[2]).toBeCloseTo(-1);
});

test("the view turns with the device, on the spot", () => {
  const view = looking([1, 0, 1], [0, 0, 0]);
  const [before, after] = [cameraOrientation(10, 60, 5, 0), cameraOrientation(40, 60, 5, 0)];
  const turned = turnedView(view, before, after);
  close(eyeOf(turned), eyeOf(view));
  const angle = Math.acos(
    turned.turn[2][0] * view.turn[2][0] + turned.turn[2][1] * view.turn[2][1] + turned.turn[2][2] * view.turn[2][2],
  );
  const [a, b] = [forward(before), forward(after)];
  expect(angle).toBeCloseTo(Math.acos(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]));
  expect(turnedView(view, before, before).turn.flat()).toEqual(
    transposed(transposed(view.turn))
      .flat()
      .map((value) => expect.closeTo(value)),
  );
});
