import { describe, expect, it } from "vitest";
import "../i18n/testing";
import type { TraceEntry } from "../protocol/types";
import { initialState, type State } from "../store/state";
import { isLate, stepsOf } from "./step";
import { meta, number, program, TYPES } from "./testing";

const AT = "2026-01-02T00:00:10+00:00";
const call = (n: number, of: Partial<TraceEntry>): TraceEntry => ({
  run: 1,
  number: n,
  action_id: "a",
  name: "a",
  started: AT,
  ...of,
});

function running(trace: TraceEntry[]): State {
  const state = initialState();
  const unit = { name: "by", type: "double", dynamic_value: false, extra: '{"unit": "m"}' };
  const count = { ...meta("count", ["integer"], [unit]), description: "Count the parts; return their number. Slowly." };
  return {
    ...state,
    doc: program({ a: "count" }, [], { a: { type: "double", value: "0.08" } }),
    types: { ...TYPES, actions: { Device: [count, meta("act", [], [number])] } },
    program: { ...state.program, state: "running", running: ["a", "unknown"], trace },
  };
}

describe("the running step", () => {
  it("tells what the device does, with parameters in the units of the editor", () => {
    const [step, ...others] = stepsOf(running([]));
    expect(others).toEqual([]);
    expect(step).toMatchObject({ name: "a", device: "device", does: "Count the parts", values: "by 80\u00a0mm" });
    expect([step?.started, step?.usual]).toEqual([undefined, undefined]);
  });

  it("shows the value that a running action has received instead of the name of a result", () => {
    const values = (...trace: TraceEntry[]) => {
      const state = running(trace);
      const { a } = state.doc?.actions ?? {};
      if (a) a.parameters = [{ name: "by", type: "link", value: '"b/default/0"' }];
      return stepsOf(state)[0]?.values;
    };
    expect(values(call(1, { parameters: ["0.02"] }))).toBe("by 20\u00a0mm");
    expect([values(), values(call(1, { parameters: ["0.02"], duration: 2 }))]).toEqual(["", ""]);
  });

  it("compares its duration with earlier ones that succeeded", () => {
    const [step] = stepsOf(
      running([
        call(1, { duration: 2 }),
        call(2, { duration: 90, error: "jammed" }),
        call(3, { duration: 4 }),
        call(4, { action_id: "b", duration: 50 }),
        call(5, {}),
      ]),
    );
    expect(step?.usual).toBe(3);
    expect(step?.started).toBe(Date.parse(AT));
    if (!step) throw new Error("no step");
    expect(isLate(step, Date.parse(AT) + 8_000)).toBe(false);
    expect(isLate(step, Date.parse(AT) + 10_000)).toBe(true);
    expect(isLate({ ...step, usual: undefined }, Date.parse(AT) + 900_000)).toBe(false);
  });

  it("has no start while its last call has ended", () => {
    expect(stepsOf(running([call(1, { duration: 2 })]))[0]?.started).toBeUndefined();
  });
});
