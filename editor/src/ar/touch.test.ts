import { expect, test } from "vitest";
import { add, apply, cross, type Mat3, mean, multiply, norm, rotation, scale, sub, unit, type Vec3 } from "./geometry";
import { layoutOf } from "./places";
import { randomNumbers } from "./testing";
import { fitTouched, knownPoints } from "./touch";

const KNOWN: Vec3[] = [
  [0, 0, 0],
  [0.8, 0.1, 0],
  [0.2, 0.6, 0.3],
];
/** The vertical of the workplace is y in WebXR. */
const TURN: Mat3 = multiply(rotation([-Math.PI / 2, 0, 0]), rotation([0, 0, 0.7]));
const SHIFT: Vec3 = [0.3, 0.75, -0.9];
const inXr = (point: Vec3): Vec3 => add(apply(TURN, point), SHIFT);
const moved = (by: Vec3, n: number): Vec3[] => KNOWN.map(inXr).map((each, i) => (i === n ? add(each, by) : each));
const outwards = (n: number): Vec3 => scale(unit(sub(inXr(KNOWN[n] as Vec3), mean(KNOWN.map(inXr)))), 0.06);

test("three exact points give the pose of the workplace", () => {
  const found = fitTouched(KNOWN, KNOWN.map(inXr));
  if ("problem" in found) throw new Error(found.problem);
  const e = found.workplace.elements;
  expect([e[12], e[13], e[14]]).toEqual(SHIFT.map((each) => expect.closeTo(each, 9)));
  expect([e[0], e[4], e[8]]).toEqual(TURN[0].map((each) => expect.closeTo(each, 9)));
  // An error of a few millimetres is expected from the tip of a controller.
  expect(found.error).toBeGreaterThan(0.003);
  expect(found.error).toBeLessThan(0.01);
  expect(found.grade).toBe("fair");
});

test("the stated error is that of points half a metre away", () => {
  const random = randomNumbers(3);
  const gauss = () => Math.sqrt(-2 * Math.log(random() + 1e-9)) * Math.cos(2 * Math.PI * random());
  const [middle, count] = [[0.33, 0.23, 0.1] as Vec3, 300];
  let [covered, squares, stated] = [0, 0, 0];
  for (let n = 0; n < count; n++) {
    const touched = KNOWN.map((each): Vec3 => add(inXr(each), [0.004 * gauss(), 0.004 * gauss(), 0.004 * gauss()]));
    const found = fitTouched(KNOWN, touched);
    if ("problem" in found) throw new Error(found.problem);
    const at = add(middle, [0.5, 0, 0]);
    const e = found.workplace.elements;
    const drawn: Vec3 = [0, 1, 2].map(
      (i) =>
        (e[i] as number) * at[0] + (e[4 + i] as number) * at[1] + (e[8 + i] as number) * at[2] + (e[12 + i] as number),
    ) as unknown as Vec3;
    const error = norm(sub(drawn, inXr(at)));
    if (error < 2 * found.error) covered++;
    squares += error ** 2;
    stated += found.error;
  }
  expect(covered / count).toBeGreaterThan(0.9);
  expect(stated / count).toBeGreaterThan(Math.sqrt(squares / count / 3));
  expect(stated / count).toBeLessThan(3 * Math.sqrt(squares / count));
});

test.each([0, 1, 2])("point %i that is not where it should be is named", (n) => {
  expect(fitTouched(KNOWN, moved(outwards(n), n))).toEqual({ problem: "contradicting", points: [n] });
});

test("if two points can be wrong, both are named", () => {
  // Along a circle around point 2, whose distance to point 0 stays.
  const [first, , third] = KNOWN.map(inXr) as [Vec3, Vec3, Vec3];
  const along = scale(unit(cross(sub(first, third), [0, 1, 0])), 0.05);
  expect(fitTouched(KNOWN, moved(along, 0))).toEqual({ problem: "contradicting", points: [0, 1] });
});

test("points on a line, and points in another order, are refused", () => {
  const line: Vec3[] = [
    [0, 0, 0],
    [0.4, 0.01, 0],
    [0.8, 0, 0],
  ];
  expect(fitTouched(line, line.map(inXr))).toEqual({ problem: "line", points: [0, 1, 2] });
  expect(fitTouched(KNOWN, [inXr([0, 0, 0]), inXr([0.8, 0.1, 0]), inXr([0.4, 0.05, 0.01])])).toHaveProperty(
    "problem",
    "line",
  );
  const isosceles: Vec3[] = [
    [0, 0, 0],
    [0.6, 0, 0],
    [0.3, 0.5, 0],
  ];
  const [a, b, c] = isosceles.map(inXr) as [Vec3, Vec3, Vec3];
  expect(fitTouched(isosceles, [b, a, c])).toEqual({ problem: "contradicting", points: [0, 1, 2] });
});

test("the known points are the corners of markers that are farthest apart", () => {
  const marker = (marker_id: number, x: number, y: number) => ({
    marker_id,
    pose: { position: { x, y, z: 0 }, orientation: { x: 0, y: 0, z: 0, w: 1 } },
  });
  expect(knownPoints(layoutOf({ markers: [] }).places)).toEqual([]);
  const found = knownPoints(layoutOf({ markers: [marker(1, 0, 0), marker(2, 1, 0), marker(3, 0.5, 0.8)] }).places);
  expect(found.map((each) => each.marker)).toEqual([1, 2, 3]);
  expect(found.map((each) => each.at)).toContainEqual([expect.closeTo(-0.05), expect.closeTo(-0.05), 0]);
});
