import { expect, test } from "vitest";
import { setTranslations } from "../../i18n/testing";
import type { Observation } from "../../protocol/types";
import { charts, NO_HISTORY, SPAN, withObservations } from "./history";

const seen = (name: string, value: Observation["value"], unit = "", quality: Observation["quality"] = "good") => ({
  name,
  value,
  unit,
  quality,
});
const after = (...rows: [number, Observation[]][]) =>
  rows.reduce((history, [time, observations]) => withObservations(history, { observations }, time), NO_HISTORY);

test("values are in the units and the language of the user", () => {
  setTranslations({ Position: "Poloha" });
  const { times, series } = after([100, [seen("Position", 0.25, "m"), seen("lamp", true)]]);
  setTranslations({});
  expect(times).toEqual([100]);
  expect(series.map(({ name, unit, binary, values }) => [name, unit, binary, values])).toEqual([
    ["Poloha", "mm", false, [250]],
    ["lamp", "", true, [1]],
  ]);
});

test("bad quality, missing values, and times without observations are gaps", () => {
  const history = after(
    [100, [seen("p", 1, "bar")]],
    [100.5, [seen("p", 7, "bar", "bad"), seen("late", 3)]],
    [101, [seen("p", 2, "bar", "uncertain")]],
    [110, [seen("p", 3, "bar")]],
  );
  expect(history.times).toEqual([100, 100.5, 101, 101.75, 110]);
  expect(history.series.map(({ id, values }) => [id, values])).toEqual([
    ["p", [1, null, 2, null, 3]],
    ["late", [null, 3, null, null, null]],
  ]);
  expect(history.series[1]?.last).toMatchObject({ value: null, quality: "bad" });
  const failed = withObservations(history, { observations: [], reason: "The connection is lost." }, 110.5);
  expect(failed.failure).toBe("The connection is lost.");
  expect(failed.series[0]?.values.at(-1)).toBeNull();
});

test("the history has the last minutes, and its columns equal lengths", () => {
  let history = NO_HISTORY;
  for (let second = 0; second <= 2 * SPAN; second++)
    history = withObservations(history, { observations: [seen("p", second)] }, second);
  expect([history.times[0], history.times.at(-1)]).toEqual([SPAN, 2 * SPAN]);
  expect(history.series[0]?.values.length).toBe(history.times.length);
});

test("values of the same unit share a chart up to its limit", () => {
  const { series } = after([
    1,
    [seen("a", 1, "V"), seen("b", 1, "A"), seen("c", 1, "V"), seen("d", true), seen("e", 1, "V")],
  ]);
  expect(charts(series, 2).map((group) => group.map(({ id }) => id))).toEqual([["a", "c"], ["e"], ["b"], ["d"]]);
});
