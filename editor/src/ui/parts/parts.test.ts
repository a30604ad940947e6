import { describe, expect, test } from "vitest";
import type { Part, PartInventory, Place } from "../../protocol/types";
import { answersFor, askedParts, whyNot, withInventory } from "./PartsCard";

const place = (id: string, capacity = 1): Place => ({ id, name: id, kind: "holder", capacity, parts: [] });
const part = (number: number, where: string, confirmed: boolean, moving_to?: string): Part => ({
  number,
  place: where,
  serial: "",
  confirmed,
  ...(moving_to ? { moving_to } : {}),
});
const inventory: PartInventory = {
  scene_id: "scn_1",
  parts: [part(1, "nest", true), part(2, "robot", false, "tester")],
  places: [place("box", 0), place("nest"), place("tester"), place("robot")],
  counts: { fed: 2, good: 0, bad: 0, rejected: 0, in_cell: 2 },
};

describe("the question about a part", () => {
  test("is about parts that are not confirmed, or about all", () => {
    expect(askedParts(inventory, false).map((each) => each.number)).toEqual([2]);
    expect(askedParts(inventory, true).map((each) => each.number)).toEqual([1, 2]);
  });

  test("offers the likely places first, and no occupied one", () => {
    const answers = answersFor(part(2, "robot", false, "tester"), inventory);
    expect(answers.map((each) => each.id)).toEqual(["robot", "tester", "box"]);
  });

  test("follows changed inventory", () => {
    const changed = { ...inventory, parts: [] };
    expect(withInventory([inventory], changed)).toEqual([changed]);
    expect(withInventory([], inventory)).toEqual([inventory]);
  });

  test("says why an interrupted program cannot continue", () => {
    expect(whyNot("picture", true)).toContain("picture");
    expect(whyNot("", false)).toContain("open project");
    expect(whyNot("", true)).toContain("is not stored");
  });
});
