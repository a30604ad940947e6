import { expect, test } from "vitest";
import type { CellStatus } from "../../protocol/types";
import { ROLES } from "../../protocol/types";
import { getState } from "../../store/store";
import { whyNoResume, whyNoStart } from "./starting";
import "../../i18n/testing";

const CELL: CellStatus = { state: "idle", mode: "produce", authority: "hub", jobs: [], held_by_plc: false };
const STATE = {
  ...getState(),
  connection: { ...getState().connection, status: "ready" as const, role: ROLES.operator },
};
const FORCE = { id: "1", object_id: "obj", object: "io", point: "lamp", value: true, unit: "", user: "Eva", since: "" };

test("Start says why the server would refuse it", () => {
  const why = (cell: Partial<CellStatus>, state = {}) => whyNoStart({ ...STATE, ...state }, { ...CELL, ...cell });
  expect(why({})).toBe("");
  expect(whyNoStart(STATE, undefined)).toBe("");
  expect(why({ authority: "plc" })).toMatch(/^Only the PLC/);
  expect(why({ authority: "nobody" })).toMatch(/until a technician gives the authority/);
  expect(why({ mode: "manual" })).toMatch(/mode manual/);
  expect(why({ mode: "changeover" })).toBe("");
  expect(why({ mode: "maintenance" })).toMatch(/^Only technicians/);
  expect(why({ mode: "maintenance" }, { connection: { ...STATE.connection, role: ROLES.technician } })).toBe("");
  expect(why({ authority: "plc" }, { forces: [FORCE] })).toBe("io: lamp is forced. End the force first.");
  expect(why({}, { connection: { ...STATE.connection, status: "lost" } })).toBe("Not connected to the server.");
});

test("a program that the PLC holds is resumed by the PLC", () => {
  expect(whyNoResume(CELL)).toBe("");
  expect(whyNoResume({ ...CELL, held_by_plc: true })).toMatch(/^The PLC holds/);
});
