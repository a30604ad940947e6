import { describe, expect, it } from "vitest";
import type { FleetCard, FleetState } from "../protocol/types";
import { controlOf, groups, levelOf, reasonOf, stateText } from "./attention";
import { updated } from "./feed";

const STATE: FleetState = {
  identity: "a",
  boot: "-",
  number: 0,
  version: "0.1.0",
  state: "execute",
  mode: "produce",
  authority: "hub",
  program_state: "running",
  address: "",
  domain: "",
  program: "Sort",
  recipe: "",
  held: false,
  good: 0,
  bad: 0,
  rejected: 0,
  urgent: 0,
  high: 0,
  medium: 0,
  low: 0,
  started_by: "Eva",
  users: [],
  controlling: [],
  missing: [],
  waiting: 0,
};

function card(name: string, state: Partial<FleetState> = {}, more: Partial<FleetCard> = {}): FleetCard {
  const seen = "2026-01-02T03:04:05+00:00";
  return { id: `${name}:a`, name, alive: true, conflict: false, seen, state: { ...STATE, ...state }, ...more };
}

describe("cells that need attention", () => {
  it.each([
    ["running", card("a")],
    ["running", card("a", { low: 3 })],
    ["ready", card("a", { state: "idle" })],
    ["watch", card("a", { medium: 1 })],
    ["watch", card("a", { missing: ["camera"] })],
    ["watch", card("a", { state: "held" })],
    ["need", card("a", { high: 1 })],
    ["need", card("a", { held: true })],
    ["need", card("a", { state: "aborted" })],
    ["gone", card("a", { held: true }, { alive: false })],
    ["need", card("a", {}, { alive: false, conflict: true })],
  ])("is %s", (level, each) => {
    expect(levelOf(each)).toBe(level);
  });

  it("is listed first, and by name", () => {
    const cards = [card("p-10"), card("p-9"), card("z", { held: true }), card("b", {}, { alive: false })];
    expect(groups(cards).map(([level, members]) => [level, members.map((each) => each.name)])).toEqual([
      ["need", ["z"]],
      ["running", ["p-9", "p-10"]],
      ["gone", ["b"]],
    ]);
  });

  it("is explained by the first alarm, else by missing devices", () => {
    const first_alarm = {
      priority: "high",
      text: "No part.",
      raised: "",
      device: "Gripper",
      translations: {},
    } as const;
    expect(reasonOf(card("a", { first_alarm, missing: ["camera"] }))).toBe("Gripper: No part.");
    const addressed = { ...first_alarm, text: "tower at 127.0.0.1:41893: no answer", device: "" };
    expect(reasonOf(card("a", { first_alarm: addressed }))).toBe("tower: no answer");
    expect(reasonOf(card("a", { missing: ["camera", "scale"] }))).toBe("Not connected: camera, scale");
    expect(reasonOf(card("a", { first_alarm }, { alive: false }))).toBe("");
    expect(stateText(card("a", { held: true }))).toBe("Waits for a person");
  });
});

describe("who controls a cell", () => {
  it.each([
    ["Eva", {}],
    ["Eva, Jan", { controlling: ["Jan", "Eva"] }],
    ["", { started_by: "" }],
    ["PLC", { authority: "plc" }],
  ] as const)("is %s", (who, state) => {
    expect(controlOf({ ...STATE, ...state } as FleetState)).toBe(who);
  });
});

describe("updates of the page", () => {
  const known = updated(new Map(), { cells: [card("a"), card("b")], removed: [], broker: true }, true);

  it("replace and remove cards", () => {
    const next = updated(known, { cells: [card("b", { good: 1 })], removed: ["a:a"], broker: true }, false);
    expect([...next.values()].map((each) => [each.name, each.state.good])).toEqual([["b", 1]]);
  });

  it("without a change keep the object, so that nothing is drawn", () => {
    expect(updated(known, { cells: [], removed: [], broker: true }, false)).toBe(known);
  });

  it("start again after a lost connection", () => {
    expect([...updated(known, { cells: [card("c")], removed: [], broker: true }, true).keys()]).toEqual(["c:a"]);
  });
});
