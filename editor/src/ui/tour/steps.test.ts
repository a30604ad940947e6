import { expect, test } from "vitest";
import type { State } from "../../store/state";
import { STEPS } from "./steps";

const state = (change: object = {}): State =>
  ({
    ui: { tool: "" },
    live: { state: "stopped", motions: 0 },
    doc: { points: { old: {} }, actions: { old: {} } },
    program: { state: "stopped" },
    ...change,
  }) as unknown as State;

/** What a user does in each step; null: read, then press “Next”. */
const DONE: readonly (object | null)[] = [
  null,
  { ui: { tool: "things" } },
  { live: { state: "started", motions: 0 } },
  { ui: { tool: "robot" } },
  { live: { state: "started", motions: 1 } },
  { doc: { points: { old: {}, new: {} }, actions: { old: {} } } },
  { ui: { tool: "program" } },
  { doc: { points: { old: {} }, actions: { old: {}, new: {} } } },
  { program: { state: "running" } },
  { program: { state: "paused" } },
];

test("the tour has ten steps, and each continues when the user has done it, not before", () => {
  expect(STEPS).toHaveLength(10);
  STEPS.forEach(({ done }, n) => {
    const change = DONE[n];
    if (!change) return expect(done, `step ${n}`).toBeUndefined();
    expect(done?.(state(), state()), `step ${n} at its start`).toBe(false);
    expect(done?.(state(change), state()), `step ${n} at its end`).toBe(true);
  });
});

test("what was there before the step does not count as done", () => {
  const [point, action] = [STEPS[5], STEPS[7]];
  const full = state({ doc: { points: { a: {}, b: {} }, actions: { a: {}, b: {} } } });
  expect(point?.done?.(full, full)).toBe(false);
  expect(action?.done?.(full, full)).toBe(false);
  expect(point?.done?.(state({ doc: null }), state())).toBe(false);
});
