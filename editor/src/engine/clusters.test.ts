import { expect, test } from "vitest";
import { boxOf, clustersOf, overlap, type Spot } from "./clusters";

const spot = (id: string, x: number, y: number, size = 20): Spot => ({ id, x, y, size });
const ids = (spots: Spot[], taken = [] as ReturnType<typeof boxOf>[]) =>
  clustersOf(spots, 390, 600, taken).map((each) => each.ids.sort().join(""));

test("three small objects that crowd are a cluster; two, distant or large ones have their own names", () => {
  const crowd = [spot("a", 200, 300), spot("b", 220, 310), spot("c", 210, 330)];
  expect(ids(crowd)).toEqual(["abc"]);
  expect(ids(crowd.slice(1))).toEqual([]);
  expect(ids([...crowd.slice(1), spot("far", 330, 310)])).toEqual([]);
  expect(ids([...crowd.slice(1), spot("large", 205, 305, 200)])).toEqual([]);
});

test("labels of clusters are in the view and never overlap: overlapping clusters are one", () => {
  const crowd = (name: string, x: number, y: number) => [1, 2, 3].map((n) => spot(`${name}${n}`, x + n, y));
  const close = clustersOf([...crowd("a", 100, 100), ...crowd("b", 170, 110)], 390, 600, []);
  expect(close.map((each) => each.ids.length)).toEqual([6]);
  const far = clustersOf([...crowd("a", 2, 100), ...crowd("b", 300, 598)], 390, 600, []);
  expect(far).toHaveLength(2);
  for (const each of far.map(boxOf)) {
    expect(Math.min(each.left, each.top)).toBeGreaterThan(0);
    expect(each.right).toBeLessThan(390);
    expect(each.bottom).toBeLessThan(600);
  }
});

test("a cluster does not cover controls of the view", () => {
  const crowd = [spot("a", 200, 300), spot("b", 220, 310), spot("c", 210, 330)];
  const control = { left: 180, right: 260, top: 280, bottom: 320 };
  expect(ids(crowd, [control])).toEqual([]);
  expect(overlap(control, { ...control, left: 260, right: 300 })).toBe(false);
});
