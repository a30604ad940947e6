import { expect, test } from "vitest";
import { aloneIn, columnsOf, overall, pauseOf } from "./history";

const SUMMARY = {
  since: 0,
  until: 300_000,
  times: [0, 1000, 5000],
  lowest: [1, 2, 0],
  highest: [3, 2, 4],
  mean: [2, 2, 1],
};

test("a chart has a gap where nothing is known", () => {
  expect(columnsOf(SUMMARY, 10)).toEqual([
    [0, 1, 2, 5],
    [20, 20, null, 10],
    [10, 20, null, 0],
    [30, 20, null, 40],
  ]);
});

test("values without a neighbour are alone", () => {
  expect(aloneIn([7])).toEqual([0]);
  expect(aloneIn([1, 2, null, 0, null, undefined, 4])).toEqual([3, 6]);
  expect(aloneIn([])).toEqual([]);
});

test("the whole period has a lowest, a mean and a highest value", () => {
  expect(overall(SUMMARY)).toEqual([0, 5 / 3, 4]);
  expect(overall({ ...SUMMARY, lowest: [], highest: [], mean: [] })).toBeNull();
});

test("a chart that follows the present reads at most every 5 s, and at least once per minute", () => {
  expect(pauseOf("hour")).toBe(6000);
  expect(pauseOf("week")).toBe(60_000);
});
