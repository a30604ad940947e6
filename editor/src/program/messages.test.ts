import { expect, it } from "vitest";
import type { TraceEntry } from "../protocol/types";
import type { State } from "../store/state";
import { shownMessage } from "./messages";

const entry = (number: number, action_id: string, ...parameters: string[]): TraceEntry => ({
  run: 1,
  number,
  name: action_id,
  action_id,
  started: "2026-01-01T00:00:00Z",
  parameters: parameters.map((each) => JSON.stringify(each)),
});

const stateOf = (...trace: TraceEntry[]) =>
  ({
    doc: {
      objects: { obj_flow: { type: "FlowActions" }, obj_other: { type: "Display" } },
      actions: {
        greet: { type: "obj_flow/show_message" },
        warn: { type: "obj_flow/show_message" },
        wait: { type: "obj_flow/wait" },
        other: { type: "obj_other/show_message" },
      },
    },
    program: { trace },
  }) as unknown as State;

it("shows the latest message of the run", () => {
  expect(shownMessage(stateOf())).toBe("");
  expect(shownMessage(stateOf(entry(1, "greet", 'Refill "A"')))).toBe('Refill "A"');
  const later = stateOf(
    entry(1, "greet", "one"),
    entry(2, "warn", "two"),
    entry(3, "wait", "1"),
    entry(4, "other", "x"),
  );
  expect(shownMessage(later)).toBe("two");
});

it("shows nothing before the document is known", () => {
  expect(shownMessage({ ...stateOf(entry(1, "greet", "one")), doc: null })).toBe("");
});
