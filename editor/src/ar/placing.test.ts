import { expect, test } from "vitest";
import type { Point, Vec3 } from "./geometry";
import { cameraOrientation } from "./gyro";
import {
  combined,
  dragged,
  type Movement,
  movedPoint,
  movedView,
  onFloor,
  stepTowards,
  tilted,
  viewFrom,
  viewpointOf,
} from "./placing";
import { eyeOf, type Lens, projected } from "./pose";
import { looking } from "./testing";

const LENS: Lens = { focal: 1000, cx: 640, cy: 360 };
const VIEW = looking([0.5, -1, 1], [0, 0, 0]);
const close = (found: readonly number[] | null, expected: readonly number[]) =>
  expect(found).toEqual(expected.map((value) => expect.closeTo(value, 6)));

test("two movements are combined", () => {
  const [inner, outer]: Movement[] = [
    { angle: 0.3, shift: [0.1, 0.2, 0.3] },
    { angle: -0.7, shift: [-0.4, 0, 0.1] },
  ] as [Movement, Movement];
  const point: Vec3 = [0.5, -0.2, 0.1];
  const both = combined(outer as Movement, inner as Movement);
  close(movedPoint(point, both), movedPoint(movedPoint(point, inner as Movement), outer as Movement));
  // The camera sees a point of the moved workplace where it saw the point to which it moved.
  close(projected(point, movedView(VIEW, both), LENS), projected(movedPoint(point, both), VIEW, LENS) as Point);
});

test("one finger moves the workplace over the floor, and the same point stays under it", () => {
  const [from, to]: Point[] = [
    [500, 400],
    [820, 250],
  ] as [Point, Point];
  const movement = dragged([from as Point], [to as Point], VIEW, LENS) as Movement;
  expect(movement.angle).toBe(0);
  expect(movement.shift[2]).toBeCloseTo(0);
  const held = onFloor(from as Point, VIEW, LENS) as Vec3;
  close(projected(held, movedView(VIEW, movement), LENS), to as Point);
});

test("a drag that leaves the floor moves nothing", () => {
  const level = looking([0, -1, 0.3], [0, 0, 0.3]);
  expect(dragged([[640, 700]], [[640, 200]], level, LENS)).toBeNull();
});

test("two fingers turn the workplace with them, and spreading them halves the distance", () => {
  const above = looking([0, -1e-8, 2], [0, 0, 0]);
  const quarter = movedView(
    above,
    dragged(
      [
        [540, 360],
        [740, 360],
      ],
      [
        [640, 260],
        [640, 460],
      ],
      above,
      LENS,
    ) as Movement,
  );
  close(projected([0.1, 0, 0], quarter, LENS), [640, 410]);
  const half = movedView(
    above,
    dragged(
      [
        [540, 360],
        [740, 360],
      ],
      [
        [440, 360],
        [840, 360],
      ],
      above,
      LENS,
    ) as Movement,
  );
  expect(eyeOf(half)[2]).toBeCloseTo(1);
});

test.each([
  ["right", [1, 0]],
  ["left", [-1, 0]],
  ["away", [0, -1]],
  ["closer", [0, 1]],
  ["up", [0, -1]],
  ["down", [0, 1]],
] as const)("a step %s is in that direction of the picture, by its size", (direction, [x, y]) => {
  const movement = stepTowards(direction, { distance: 0.01, angle: 0.1 }, VIEW);
  expect(Math.hypot(...movement.shift)).toBeCloseTo(0.01);
  const [before, after] = [VIEW, movedView(VIEW, movement)].map((view) => projected([0, 0, 0], view, LENS) as Point);
  const by = [(after as Point)[0] - (before as Point)[0], (after as Point)[1] - (before as Point)[1]];
  expect(Math.sign(Math.round(by[0] as number))).toBe(x);
  expect(Math.sign(Math.round(by[1] as number))).toBe(y);
});

test("a turn is about the middle of the picture, to the left as seen from above", () => {
  const turned = movedView(VIEW, stepTowards("turnLeft", { distance: 0, angle: 0.1 }, VIEW));
  close(projected([0, 0, 0], turned, LENS), [640, 360]);
  const [right] = projected([0.1, 0.05, 0], VIEW, LENS) as Point;
  expect((projected([0.1, 0.05, 0], turned, LENS) as Point)[0]).toBeLessThan(right);
});

test("a camera that tilts upwards sees the workplace lower", () => {
  const [, y] = projected([0, 0, 0], tilted(VIEW, 0.1), LENS) as Point;
  expect(y).toBeCloseTo(360 + 1000 * Math.tan(0.1));
  close(eyeOf(tilted(VIEW, 0.1)), eyeOf(VIEW));
});

test("placing starts from a stored sight, upright by the motion sensor if there is one", () => {
  const sight = viewpointOf(VIEW);
  const same = viewFrom(sight, null);
  close(same.turn.flat(), VIEW.turn.flat());
  close(eyeOf(same), eyeOf(VIEW));
  const upright = viewFrom(sight, cameraOrientation(70, 50, 0, 0));
  // The device is 50° from lying flat, so the camera looks 40° below the horizon, in the same direction.
  expect(Math.asin(upright.turn[2][2])).toBeCloseTo((-40 * Math.PI) / 180);
  expect(upright.turn[2][0] / upright.turn[2][1]).toBeCloseTo(VIEW.turn[2][0] / VIEW.turn[2][1]);
  close(projected(sight.target, upright, LENS), [640, 360]);
});
