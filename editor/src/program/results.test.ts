import { describe, expect, it } from "vitest";
import type { Run } from "../protocol/types";
import { reduce } from "../store/reduce";
import { initialState, type State } from "../store/state";
import { dismissal, lastRun, resultOf, undismissedRun } from "./results";

const RUN: Run = {
  number: 7,
  package_id: "pkg",
  package_name: "sorting 1",
  started: "2026-04-01T00:00:00Z",
  end: "running",
  actions: 3,
  temporary: false,
  start_paused: false,
  project_id: "pro",
};
const FAILED: Run = {
  ...RUN,
  end: "failed",
  ended: "2026-04-01T00:00:09Z",
  last_action: { id: "act", name: "scan" },
  error: "no code was read",
};

/** Time of the events, ms since 1970. */
const NOW = 1_700_000_000_000;

function withHistory(state: State, ...runs: Run[]): State {
  for (const data of runs) state = { ...state, ...reduce(state, { event: "RunChanged", data } as never, NOW) };
  return state;
}

describe("the result of a run", () => {
  it("names the action, the error, and the project of a temporary package", () => {
    expect(resultOf(RUN)).toBeNull();
    expect(resultOf(FAILED)).toEqual({
      tone: "bad",
      title: "Run failed in scan",
      name: "sorting 1",
      detail: "no code was read",
      actionId: "act",
    });
    expect(resultOf({ ...FAILED, temporary: true, project_name: "sorting" })?.name).toBe("sorting");
    expect(resultOf({ ...RUN, end: "stopped", stopped_by: "Eva" })?.title).toBe("Run stopped by Eva");
  });

  it("is shown until it is dismissed or the next run starts", () => {
    let state = withHistory(initialState(), RUN);
    expect(undismissedRun(state)).toBeNull();
    state = withHistory(state, FAILED);
    expect(undismissedRun(state)).toEqual(FAILED);
    const dismissed = { ...state, view: { ...state.view, general: dismissal(FAILED) } };
    expect(undismissedRun(dismissed)).toBeNull();
    expect(lastRun(dismissed)).toEqual(FAILED);
    expect(undismissedRun(withHistory(state, { ...RUN, number: 8 }))).toBeNull();
    expect(undismissedRun({ ...state, program: { ...state.program, state: "started" } })).toBeNull();
    expect(undismissedRun(withHistory(dismissed, { ...FAILED, number: 8 }))?.number).toBe(8);
  });

  it("is shown to users who join later only if the run failed or was interrupted", () => {
    const later = (run: Run): State => ({ ...initialState(), program: { ...initialState().program, runs: [run] } });
    expect(undismissedRun(later(FAILED))).toEqual(FAILED);
    expect(undismissedRun(later({ ...FAILED, end: "lost" }))).not.toBeNull();
    expect(undismissedRun(later({ ...RUN, end: "finished" }))).toBeNull();
    expect(undismissedRun(withHistory(initialState(), RUN, { ...RUN, end: "finished" }))).not.toBeNull();
  });

  it("is that of the open project if a project is given", () => {
    const state = withHistory(initialState(), FAILED, { ...FAILED, number: 8, project_id: "other" });
    expect(lastRun(state)?.number).toBe(8);
    expect(lastRun(state, "pro")?.number).toBe(7);
    expect(lastRun(state, "none")).toBeUndefined();
  });
});
