import { expect, test } from "vitest";
import { ROLES } from "../../protocol/types";
import type { State } from "../../store/state";
import { STEPS, stepsOf } from "./steps";

const state = (change: object = {}): State =>
  ({
    ui: { tool: "" },
    live: { state: "stopped", motions: 0 },
    doc: { points: { old: {} }, actions: { old: {} } },
    program: { state: "stopped" },
    ...change,
  }) as unknown as State;

/** The action of the user in each step; null: read, then press “Next”. */
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

test("each role has a tour of what its users do", () => {
  const texts = (role: number) => stepsOf(role).map(({ text }) => text.message ?? text.id);
  expect(stepsOf(ROLES.advanced_user)).toBe(STEPS);
  expect(stepsOf(ROLES.programmer)).toBe(STEPS);
  const tours = [ROLES.operator, ROLES.standard_user, ROLES.advanced_user, ROLES.technician].map(texts);
  expect(new Set(tours.map((each) => each.join())).size).toBe(4);
});

test("an operator starts, pauses and resumes; each step waits for it", () => {
  const [, start, pause, resume] = stepsOf(ROLES.operator);
  const at = (phase: string) => state({ program: { state: phase } });
  const began = at("stopped");
  for (const [step, phase] of [
    [start, "running"],
    [pause, "paused"],
    [resume, "running"],
  ] as const) {
    expect(step?.done?.(at(phase), began)).toBe(true);
    expect(step?.done?.(at(phase === "paused" ? "running" : "stopped"), began)).toBe(false);
  }
});

test("a technician adds and selects an object, a standard user changes a value", () => {
  const [, , add, select] = stepsOf(ROLES.technician);
  const [, , choose, change] = stepsOf(ROLES.standard_user);
  const began = state({ doc: { objects: { a: {} }, actions: {} }, ui: { selection: null } });
  const after = state({
    doc: { objects: { a: {}, b: {} }, actions: { x: {} } },
    ui: { selection: { kind: "object" } },
  });
  for (const step of [add, select, change]) {
    expect(step?.done?.(began, began)).toBe(false);
    expect(step?.done?.(after, began)).toBe(true);
  }
  expect(choose?.done?.(after, began)).toBe(false);
  expect(choose?.done?.(state({ ui: { selection: { kind: "action" } } }), began)).toBe(true);
});
