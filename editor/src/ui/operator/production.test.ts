import { expect, it } from "vitest";
import "../../i18n/testing";
import { tilesOf } from "./Production";

it("shows cycles, their durations and counters, and good and bad parts only if the program judges them", () => {
  const counters = [{ id: "obj", name: "labels", value: 4 }];
  expect(tilesOf({ cycles: 2, counters }).map(({ name, value }) => [name, value])).toEqual([
    ["Cycles", "2"],
    ["labels", "4"],
  ]);
  const all = tilesOf({ cycles: 2, counters: [], good: 0, bad: 2, last_cycle: 12.34, mean_cycle: 75 });
  expect(all.map(({ name, value, tone }) => [name, value, tone])).toEqual([
    ["Good", "0", "good"],
    ["Bad", "2", "bad"],
    ["Cycles", "2", undefined],
    ["Last cycle", "12.3 s", undefined],
    ["Mean cycle", "1 min 15 s", undefined],
  ]);
});
