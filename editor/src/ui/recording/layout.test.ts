import { expect, test } from "vitest";
import type { RecordedAction, Recording, Signal } from "../../commands/recordings";
import { charts, columns, indexAt, lanes, moved, runningAt, shownAtFirst, traceOf, valueAt, zoomed } from "./layout";

const signal = (name: string, times: number[], values: Signal["values"], more: Partial<Signal> = {}): Signal => ({
  kind: "point",
  object_id: "obj_io",
  object_name: "io",
  name,
  unit: "",
  times,
  values,
  ...more,
});
const action = (number: number, begin: number, end?: number, object_name?: string): RecordedAction => ({
  number,
  name: `a${number}`,
  begin,
  ...(end !== undefined && { end }),
  ...(object_name !== undefined && { object_name }),
});

test("values are in the units of the user, and what is on or off is digital", () => {
  expect(traceOf(signal("level", [0], [0.25], { unit: "m" }), "rad")).toMatchObject({ unit: "mm", values: [250] });
  const joint = traceOf(signal("j1", [0], [Math.PI], { kind: "joint" }), "rad");
  expect([joint.unit, joint.digital, joint.values[0]]).toEqual(["°", false, 180]);
  expect(traceOf(signal("lamp", [0, 1], [false, true]), "")).toMatchObject({ digital: true, values: [0, 1] });
  expect(traceOf(signal("part", [0, 1], [null, true]), "")).toMatchObject({ digital: true, values: [null, 1] });
  expect(traceOf(signal("count", [0, 1], [0, 1]), "")).toMatchObject({ digital: false, unit: "" });
});

test("the signals of the device with the alarm come first, then joints, and unchanged ones are not shown", () => {
  const signals = [
    signal("j1", [-9e4, -4e4], [0, 1], { kind: "joint" }),
    signal("far", [-9e4, -4e4], [0, 1]),
    signal("still", [-9e4], [1]),
    signal("near", [-9e4, -100], [0, 1]),
    signal("own", [-9e4, -4e4], [0, 1], { object_id: "obj_tester" }),
  ];
  const alarms = [{ number: 1, time: 0, text: "x", object_id: "obj_tester" }];
  expect([...shownAtFirst({ signals, alarms } as unknown as Recording)]).toEqual([
    "obj_tester/point/own",
    "obj_io/point/near",
    "obj_io/point/far",
    "obj_io/joint/j1",
  ]);
});

test("traces with the same unit share a chart", () => {
  const trace = (name: string, unit: string) => traceOf(signal(name, [0], [2], { unit }), "");
  const groups = charts([trace("a", "V"), trace("b", "A"), trace("c", "V"), trace("d", "V")], 2);
  expect(groups.map((group) => group.map(({ name }) => name))).toEqual([["io · a", "io · c"], ["io · d"], ["io · b"]]);
});

test("a value is valid until the next one", () => {
  const trace = traceOf(signal("a", [-1000, 0, 10], [5, null, 7]), "");
  expect([-1001, -1000, -1, 0, 9, 10, 99].map((time) => valueAt(trace, time))).toEqual([null, 5, 5, null, null, 7, 7]);
  expect(indexAt([], 5)).toBe(-1);
});

test("a line stays level until shortly before the next value, and has no gaps at the times of others", () => {
  const one = traceOf(signal("a", [-1000, 0], [2, 4]), "");
  const other = traceOf(signal("b", [-1000, -900, -950], [2, null, 3]), "");
  expect(columns([one], [-1000, 500])).toEqual([
    [-1, -0.1, 0, 0.5],
    [2, 2, 4, 4],
  ]);
  const [times, a] = columns([one, other], [-1000, 500]);
  expect(times).toContain(-0.95);
  expect(a?.[times?.indexOf(-0.95) ?? -1]).toBeUndefined();
});

test("digital traces are above each other, the first one on top", () => {
  const one = traceOf(signal("a", [-10, 0], [false, true]), "");
  const other = traceOf(signal("b", [-10], [true]), "");
  expect(columns([one, other], [-10, 10])).toEqual([
    [-0.01, 0, 0.01],
    [1.5, 2.5, 2.5],
    [1, 1, 1],
  ]);
});

test("zooming keeps the time under the fingers, and nothing moves out of the recording", () => {
  const whole = [-60_000, 5000] as const;
  expect(zoomed([-60_000, 5000], 0.5, -10_000, whole)).toEqual([-35_000, -2500]);
  expect(zoomed([-1000, 0], 100, 0, whole)).toEqual(whole);
  expect(zoomed([-1000, 0], 0.001, -500, whole)).toEqual([-600, -400]);
  expect(moved([-1000, 0], 99_000, whole)).toEqual([4000, 5000]);
  expect(moved([-1000, 0], -99_000, whole)).toEqual([-60_000, -59_000]);
});

test("actions that overlap are in rows of their own, calls of functions first", () => {
  const found = lanes(
    [action(3, 50, 60, "io"), action(2, 0, 100, "robot"), action(1, 0), action(4, 20, 40, "robot")],
    500,
  );
  expect(found.map(({ name, rows }) => [name, rows])).toEqual([
    ["", 1],
    ["robot", 2],
    ["io", 1],
  ]);
  expect(found[1]?.bands.map(({ action: { number }, row }) => [number, row])).toEqual([
    [2, 0],
    [4, 1],
  ]);
});

test("an action runs from its begin until before its end", () => {
  const actions = [action(1, 0, 10), action(2, 10)];
  expect([-1, 0, 9, 10, 99].map((time) => runningAt(actions, time).map(({ number }) => number))).toEqual([
    [],
    [1],
    [1],
    [2],
    [2],
  ]);
});
