/** Long graphs in columns. */

import { expect, test } from "vitest";
import { program, TYPES } from "../../program/testing";
import { inColumns } from "./columns";
import { graphOf } from "./graph";

const TABLET = { width: 1188, height: 740 };

function chain(count: number, extra: [string, string, string?][] = []) {
  const ids = [...Array(count).keys()].map((n) => `a${n}`);
  const steps = ["START", ...ids].map((id, n): [string, string] => [id, ids[n] ?? "END"]);
  return graphOf(program(Object.fromEntries(ids.map((id) => [id, "act"])), [...steps, ...extra]), TYPES);
}
const heightOf = (boxes: { y: number; height: number }[]) =>
  Math.max(...boxes.map((each) => each.y + each.height)) - Math.min(...boxes.map((each) => each.y));

test("a program of 100 actions is a few screens tall instead of a dozen, without overlaps", () => {
  const tall = chain(100);
  const { boxes, detours } = inColumns(tall, TABLET);
  expect(heightOf(tall.boxes)).toBeGreaterThan(10_000);
  expect(heightOf(boxes)).toBeLessThan(heightOf(tall.boxes) / 3);
  expect(detours.size).toBe(3);
  for (const one of boxes)
    for (const other of boxes) {
      const apart =
        one === other ||
        one.x + one.width <= other.x ||
        other.x + other.width <= one.x ||
        one.y + one.height <= other.y ||
        other.y + other.height <= one.y;
      expect(apart).toBe(true);
    }
  // The connection runs between the columns.
  const { right = 0, left = 0 } = [...detours.values()][0] ?? {};
  expect(right).toBe(left);
  expect(boxes.some((each) => each.x < right && right < each.x + each.width)).toBe(false);
});

test("a graph that fits, or a narrow view, has one column", () => {
  const short = chain(3);
  expect(inColumns(short, TABLET).boxes).toBe(short.boxes);
  const tall = chain(40);
  expect(inColumns(tall, { width: 390, height: 600 }).boxes).toBe(tall.boxes);
  expect(inColumns(tall, { width: 0, height: 0 }).boxes).toBe(tall.boxes);
});

test("a connection over several columns passes above them", () => {
  const { boxes, detours } = inColumns(chain(60, [["a1", "END", "on error"]]), TABLET);
  const far = [...detours.values()].find((each) => each.left - each.right > 200);
  expect(far && far.above < Math.min(...boxes.map((each) => each.y))).toBe(true);
});
