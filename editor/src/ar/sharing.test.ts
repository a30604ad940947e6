import { expect, test, vi } from "vitest";
import type { Pose } from "../protocol/types";
import { apply, rotationOf } from "./geometry";
import { CameraReporter, PERIOD } from "./sharing";
import { looking } from "./testing";

test("the pose is reported at most twice a second, when it changes, and until it is unknown", () => {
  const report = vi.fn((_camera: Pose | null) => {});
  const sharing = new CameraReporter(report);
  sharing.take(null, 0);
  expect(report).not.toHaveBeenCalled();
  sharing.take(looking([1, 0, 1], [0, 0, 0]), 0);
  const camera = report.mock.lastCall?.[0] as Pose;
  expect(camera.position).toEqual({ x: expect.closeTo(1), y: expect.closeTo(0), z: expect.closeTo(1) });
  const { x, y, z, w } = camera.orientation;
  const forward = apply(rotationOf(x, y, z, w), [0, 0, 1]);
  expect(forward).toEqual([-Math.SQRT1_2, 0, -Math.SQRT1_2].map((value) => expect.closeTo(value)));
  sharing.take(looking([1.5, 0, 1], [0, 0, 0]), PERIOD - 1);
  sharing.take(looking([1.001, 0, 1], [0.001, 0, 0]), 2 * PERIOD);
  expect(report).toHaveBeenCalledTimes(1);
  sharing.take(looking([1.5, 0, 1], [0, 0, 0]), 2 * PERIOD + 1);
  expect(report).toHaveBeenCalledTimes(2);
  sharing.take(null, 2 * PERIOD + 2);
  sharing.take(null, 2 * PERIOD + 3);
  expect(report.mock.calls.slice(2)).toEqual([[null]]);
});
