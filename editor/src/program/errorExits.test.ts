import { expect, test } from "vitest";
import type { TraceEntry } from "../protocol/types";
import { initialState, type OpenDocument, type State } from "../store/state";
import { insertion, slotFor, slotsOf } from "./chain";
import { errorAt, freeKinds, hasFailed, switched, usableErrors } from "./errorExits";
import { KIND_NAMES } from "./errorKinds";
import { branchKind, cannotLead, conditionWords, freeStep, usable } from "./logic";
import { freeErrorName } from "./naming";
import { problemsOf, usersOf } from "./problems";
import { runsOf } from "./runs";
import { valuesOf } from "./step";
import { takenExit } from "./takenExit";
import { program, TYPES } from "./testing";

/** Scan, then place; an error is shown, and the board is dropped. */
const scanning = (parameters: Record<string, object> = {}): OpenDocument =>
  program(
    { scan: "count", place: "show", report: "show", drop: "show" },
    [
      ["START", "scan"],
      ["scan", "place"],
      ["scan", "report", "on refused stale"],
      ["report", "drop"],
      ["place", "drop"],
      ["drop", "END"],
    ],
    parameters,
  );
const texts = (doc: OpenDocument) => problemsOf(doc, TYPES).map((each) => `${each.level} ${each.id}: ${each.text}`);

test("an error exit does not count as a condition or as a second next step", () => {
  const doc = scanning();
  const exit = doc.logic.s2;
  expect(exit && [branchKind(exit), conditionWords(doc, TYPES, exit)]).toEqual(["error", "on error: 2 kinds"]);
  expect(doc.logic.s1 && conditionWords(doc, TYPES, doc.logic.s1)).toBe("");
  expect(texts(doc)).toEqual([]);
  expect(freeStep(doc, TYPES, "scan")).toMatchObject({}); // the branches of its result are free
  expect(runsOf(doc)).toEqual([]);
});

test("an error exit can lead where the next step leads, but not to another exit's target or back", () => {
  const doc = scanning();
  expect(cannotLead(doc, "scan", "place", "", true)).toBe("");
  expect(cannotLead(doc, "scan", "place")).toMatch("already connected");
  expect(cannotLead(doc, "scan", "report", "", true)).toMatch("already connected");
  expect(cannotLead(doc, "scan", "report", "s2")).toBe("");
  expect(cannotLead(doc, "drop", "scan", "", true)).toMatch("loop");
  expect(cannotLead(doc, "START", "drop", "", true)).toMatch("cannot fail");
});

test("every kind of error has one exit, and any error stands alone", () => {
  const doc = scanning();
  expect(freeKinds(doc, "scan")[0]).toBe("error");
  expect(freeKinds(doc, "scan")).toHaveLength(Object.keys(KIND_NAMES).length - 2);
  expect(freeKinds(doc, "scan", "s2")).toContain("stale");
  expect(switched(["refused"], "stale")).toEqual(["refused", "stale"]);
  expect(switched(["refused", "stale"], "refused")).toEqual(["stale"]);
  expect(switched(["stale"], "stale")).toEqual(["stale"]);
  expect(switched(["refused", "stale"], "error")).toEqual(["error"]);
  expect(switched(["error"], "stale")).toEqual(["stale"]);
});

test("the error can be used where the action has failed, its results where it has not", () => {
  const doc = scanning();
  expect(hasFailed(doc, "scan", "report")).toBe(true);
  expect([hasFailed(doc, "scan", "place"), hasFailed(doc, "scan", "drop")]).toEqual([false, false]);
  expect(usableErrors(doc, "report").map((each) => `${each.name} of ${each.action.name}`)).toEqual([
    "failed device of scan",
    "kind of the error of scan",
    "text of the error of scan",
  ]);
  expect(usableErrors(doc, "drop")).toEqual([]);
  const results = (id: string) => usable(doc, TYPES, id, "integer").map((each) => each.name);
  expect([results("place"), results("report"), results("drop")]).toEqual([["scan_result"], [], []]);
});

test("wrong uses of an error and of a failed action are reported", () => {
  const link = (value: string) => ({ type: "link", value: JSON.stringify(value) });
  expect(texts(scanning({ report: link("scan/error/2") }))).toEqual([]);
  expect(texts(scanning({ drop: link("scan/error/2") }))).toEqual([
    "error drop: drop: by uses the error of scan, which has not failed on all paths to it.",
  ]);
  expect(texts(scanning({ report: link("place/error/2") }))).toEqual([
    "error report: report: the error used for by is not stored.",
  ]);
  expect(texts(scanning({ drop: link("scan/default/0") }))).toEqual([
    "error drop: drop: by uses a result of scan, which can have failed before it.",
  ]);
});

test("the error has a name and words", () => {
  const doc = scanning({ report: { type: "link", value: '"scan/error/2"' } });
  expect(errorAt(doc, "scan/error/3")).toBeUndefined();
  expect(doc.actions.report && valuesOf(doc, TYPES, doc.actions.report)).toBe("by text of the error of scan");
  expect(usersOf(doc, TYPES, { error: "scan" })).toEqual(["report"]);
  expect(freeErrorName(doc, { name: "scan", type: "device/scan" })).toBe("scan_error_2");
});

test("actions are added on an error exit", () => {
  const doc = scanning();
  expect(slotsOf(doc, TYPES)).toContainEqual({ after: "scan", exit: "s2" });
  expect(slotFor(doc, TYPES, "s2")).toEqual({ after: "scan", exit: "s2" });
  expect(insertion(doc, { after: "scan", exit: "s2" })).toEqual({ redirect: "s2", to: "report" });
});

test("the exit that a running program took is known until the next cycle", () => {
  const doc = scanning();
  const taken = (...ids: string[]) => {
    const trace = ids.map(
      (text, number): TraceEntry => ({
        run: 1,
        number,
        name: "",
        action_id: text.replace(/[!+]/g, ""),
        ...(text.includes("+") && { attempt: 2 }),
        started: "2026-01-01T00:00:00Z",
        ...(text.endsWith("!") && { error: "failed" }),
      }),
    );
    const state: State = { ...initialState(), doc };
    return takenExit({ ...state, program: { ...state.program, state: "running", trace } })?.id;
  };
  expect(taken("scan", "place")).toBeUndefined();
  expect(taken("scan!")).toBeUndefined();
  expect(taken("scan!", "report")).toBe("s2");
  expect(taken("scan!", "report", "drop")).toBe("s2");
  expect(taken("scan!", "report", "drop", "scan")).toBeUndefined();
  expect(taken("scan", "place", "drop", "scan!", "report")).toBe("s2");
  // A failed attempt that is repeated takes no exit.
  expect(taken("scan!", "scan+", "place")).toBeUndefined();
  expect(taken("scan!", "scan+!", "report")).toBe("s2");
  const ends = Object.values(doc.logic).find((each) => each.id === "s2");
  if (ends) ends.end = "END";
  expect(taken("scan!", "scan+")).toBeUndefined();
  expect(taken("scan!", "scan")).toBe("s2");
});
