import { describe, expect, it } from "vitest";
import type { DeviceCard } from "../protocol/types";
import { differenceOf, isOtherUnit, sortedCards } from "./maintenance";

const card = (more: Partial<DeviceCard> = {}): DeviceCard => ({
  object_id: "obj_1",
  name: "robot",
  object_type: "UR5e",
  identity: { vendor: "UR", model: "UR5", serial: "1", firmware: "5.1" },
  first_seen: "",
  seen: "",
  counted_since: "",
  differing: [],
  parameters: false,
  restores: false,
  hours: 0,
  cycles: 0,
  counters: {},
  backups: [],
  ...more,
});

const found = { vendor: "UR", model: "UR5", serial: "2", firmware: "5.2" };

describe("device cards", () => {
  it("name the serial number before the firmware", () => {
    const swapped = card({ found, differing: ["serial", "firmware"] });
    expect(differenceOf(swapped)).toBe("This is a different UR5: serial number 2 instead of 1.");
    expect(isOtherUnit(swapped)).toBe(true);
  });

  it("tell a new firmware from a new unit", () => {
    const updated = card({ found, differing: ["firmware"] });
    expect(differenceOf(updated)).toBe("This device has another firmware: 5.2 instead of 5.1.");
    expect(isOtherUnit(updated)).toBe(false);
    expect(differenceOf(card())).toBe("");
  });

  it("come first when they need a technician", () => {
    const cards = [card({ name: "belt" }), card({ name: "robot", found, differing: ["serial"] })];
    expect(sortedCards(cards).map((each) => each.name)).toEqual(["robot", "belt"]);
  });
});
