/** The enumerations that actions of a function take. */

import { expect, test } from "vitest";
import { enumerationsOf } from "./enumerations";
import { meta, number, program, TYPES } from "./testing";

test("values of enumerations are found, but no numbers, and no values that are passed on", () => {
  const way = { ...number, name: "move_type", type: "string_enum" };
  const types = { ...TYPES, actions: { Device: [meta("count", ["integer"], [way, number])] } };
  const doc = program({ a: "count", b: "count", c: "count" }, [], {
    a: { name: "move_type", type: "string_enum", value: '"linear"' },
    b: { name: "move_type", type: "function_parameter", value: '"way"' },
  });
  expect(enumerationsOf(doc, types)).toEqual([
    { action: "a", parameter: "move_type", type: "string_enum", json: '"linear"', label: "move type of a" },
  ]);
});
