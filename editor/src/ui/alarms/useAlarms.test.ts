import { expect, test } from "vitest";
import type { AlarmRecord } from "../../protocol/types";
import { firstUp, withChanged } from "./useAlarms";

const alarm = (number: number, of: Partial<AlarmRecord> = {}) =>
  ({ number, first_up: number, priority: "high", retain: true, acknowledged: false, ...of }) as AlarmRecord;

test("the first cause is shown and its consequences come before other alarms", () => {
  const alarms = [alarm(9), alarm(4, { first_up: 3 }), alarm(3), alarm(5, { first_up: 3, priority: "urgent" })];
  const { first, others } = firstUp(alarms);
  expect(first?.number).toBe(3);
  expect(others.map((each) => each.number)).toEqual([4, 5, 9]);
});

test("an acknowledged alarm gives way to one that nobody has seen", () => {
  expect(firstUp([alarm(2, { priority: "low" }), alarm(1, { acknowledged: true })]).first?.number).toBe(2);
  expect(firstUp([]).first).toBeUndefined();
});

test("a group whose first alarm has ended is still shown", () => {
  expect(firstUp([alarm(5, { first_up: 3 }), alarm(4, { first_up: 3 })]).first?.number).toBe(4);
});

test("a changed alarm is replaced, added or removed by its state", () => {
  const known = [alarm(2), alarm(1)];
  expect(withChanged(known, alarm(3), "retained").map((each) => each.number)).toEqual([3, 2, 1]);
  expect(withChanged(known, alarm(1, { retain: false }), "retained").map((each) => each.number)).toEqual([2]);
  expect(withChanged(known, alarm(2, { shelved_until: "2026" }), "retained").map((each) => each.number)).toEqual([1]);
  expect(withChanged(known, alarm(1, { retain: false }), "all")).toHaveLength(2);
});
