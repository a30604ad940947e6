import { expect, test } from "vitest";
import type { CellStatus } from "../../protocol/types";
import { noteText, plcText, programText } from "./texts";
import "../../i18n/testing";

const DEFAULT: CellStatus = { state: "idle", mode: "produce", authority: "hub", jobs: [], held_by_plc: false };
const LINK = { listening: "10.0.0.1:502", alive: true, peer: "10.0.0.2" };

test("the operator's screen shows only what differs from the default", () => {
  expect(noteText(DEFAULT)).toBe("");
  expect(noteText({ ...DEFAULT, mode: "maintenance" })).toBe("Mode: Maintenance.");
  expect(noteText({ ...DEFAULT, authority: "nobody", mode: "manual" })).toBe(
    "Nobody commands this cell. Mode: Manual.",
  );
  const commanded: CellStatus = { ...DEFAULT, authority: "plc", plc: LINK };
  expect(noteText(commanded)).toBe("The PLC commands this cell.");
  expect(noteText({ ...commanded, plc: { ...LINK, alive: false } })).toContain("does not change");
});

test("plant systems need no life counter", () => {
  const plant: CellStatus = { ...DEFAULT, opcua: true };
  expect(plcText(plant)).toMatchObject({ tone: "good", text: "Plant systems connect by OPC UA." });
  expect(noteText({ ...plant, authority: "plc" })).toBe("A plant system commands this cell.");
  expect(noteText({ ...plant, authority: "plc", plc: { ...LINK, alive: false } })).toContain("does not change");
});

test("a silent PLC is an error only while it commands the cell", () => {
  expect(plcText(DEFAULT)).toMatchObject({ word: "", text: "The server has no connection for a PLC." });
  const { peer: _, ...listening } = LINK;
  expect(plcText({ ...DEFAULT, plc: { ...listening, alive: false } })).toMatchObject({
    word: "",
    text: "No PLC has written to 10.0.0.1:502 yet.",
  });
  expect(plcText({ ...DEFAULT, plc: LINK })).toMatchObject({ word: "alive", tone: "good" });
  const silent: CellStatus = { ...DEFAULT, plc: { ...LINK, alive: false } };
  expect(plcText(silent)).toMatchObject({ word: "silent", tone: "warn" });
  expect(plcText({ ...silent, authority: "plc" })).toMatchObject({ tone: "bad" });
});

test("the dialog says what the PLC has commanded", () => {
  expect(programText(DEFAULT)).toBe("");
  expect(programText({ ...DEFAULT, state: "execute", job: 3 })).toBe("Job 3 of the PLC is active.");
  expect(programText({ ...DEFAULT, state: "held", job: 3, held_by_plc: true })).toContain("The PLC holds the program");
  expect(programText({ ...DEFAULT, state: "aborted" })).toContain("failed");
});
