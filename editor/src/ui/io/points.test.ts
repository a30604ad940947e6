import { describe, expect, it } from "vitest";
import type { LivePoint, SceneObject } from "../../protocol/types";
import { type Reported, shownDevices, valueText } from "./points";

const OBJECTS = [
  { id: "b", name: "tower", type: "TowerLight" },
  { id: "a", name: "io", type: "RemoteIO" },
  { id: "c", name: "table", type: "Table" },
] as SceneObject[];

const point = (name: string, more: Partial<LivePoint> = {}): LivePoint => ({
  name,
  use: "input",
  value: true,
  unit: "",
  quality: "good",
  age: 0.1,
  ...more,
});

const report = (points: LivePoint[], at = 100, reason?: string): Reported => ({
  object_id: "",
  time_ms: 0,
  points,
  at,
  ...(reason && { reason }),
});

const REPORTED = new Map([
  ["a", report([point("valve", { use: "output", force: "digital" }), point("level", { value: 0.25, unit: "m" })])],
  ["b", report([point("red")])],
]);

function shown(filter: { device?: string; text?: string } = {}, time = 100.2, connected = true, reported = REPORTED) {
  return shownDevices(OBJECTS, reported, { device: "", text: "", ...filter }, { time, connected }, () => [
    { name: "supply_voltage", type: "double", description: "", unit: "V" },
  ]);
}

describe("shownDevices", () => {
  it("lists devices by name, without those that have no points", () => {
    expect(shown().map((each) => [each.name, each.points.map(({ id }) => id)])).toEqual([
      ["io", ["valve", "level"]],
      ["tower", ["red"]],
    ]);
  });

  it("searches names of devices and points, and one device", () => {
    expect(shown({ text: "IO val" }).flatMap((each) => each.points.map(({ id }) => id))).toEqual(["valve"]);
    expect(shown({ device: "b" }).map((each) => each.name)).toEqual(["tower"]);
    expect(shown({ text: "red", device: "a" })).toEqual([]);
  });

  it("shows values that are not renewed as stale, and those of a lost connection as not connected", () => {
    const [fresh] = shown()[0]?.points ?? [];
    expect(fresh).toMatchObject({ quality: "good", age: "", text: "on", on: true });
    const [late] = shown({}, 112)[0]?.points ?? [];
    expect(late?.quality).toBe("stale");
    expect(late?.age).toMatch(/^12/);
    expect(shown({}, 100.2, false)[0]?.points[0]?.quality).toBe("not_connected");
    const bad = new Map([["a", report([point("level", { value: null, quality: "bad" })])]]);
    expect(shown({}, 112, true, bad)[0]?.points[0]).toMatchObject({ quality: "bad", text: "unknown" });
  });

  it("takes the unit of a signal from its declaration, and shows its name in words", () => {
    const signal = point("supply_voltage", { use: "signal", value: 24.5 });
    const reported = new Map([["a", report([signal])]]);
    expect(shown({ text: "supply voltage" }, 100, true, reported)[0]?.points[0]).toMatchObject({
      name: "supply voltage",
      text: "24.5\u00a0V",
    });
  });

  it("shows why the points of a device are not known", () => {
    const reported = new Map([["a", report([], 100, "io: the connection is lost")]]);
    expect(shown({}, 100, true, reported)).toEqual([
      { id: "a", name: "io", points: [], reason: "io: the connection is lost" },
    ]);
  });
});

it("shows values in units of the user", () => {
  expect(valueText(0.25, "m")).toBe("250\u00a0mm");
  expect(valueText(false, "")).toBe("off");
  expect(valueText("blocked", "")).toBe("blocked");
  expect(valueText(null, "m")).toBe("unknown");
});
