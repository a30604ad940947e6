import { readFileSync } from "node:fs";
import { join } from "node:path";
import { expect, test } from "vitest";
import type { LogicWhen } from "../protocol/types";
import { casesOf } from "./completeness";
import { program, TYPES } from "./testing";

interface Known {
  types: Record<string, string>;
  cases: { conditions: LogicWhen[]; known: boolean; unused: number[]; complete: boolean }[];
}

/** The cases that test_build_conditions.py compares with the server. */
const KNOWN = "../../../tests/server/build/conditions.json";

test("the editor decides which conditions are complete as the server does", () => {
  const { types, cases } = JSON.parse(readFileSync(join(import.meta.dirname, KNOWN), "utf8")) as Known;
  const doc = program({});
  for (const [id, type] of Object.entries(types)) doc.parameters[id] = { id, name: id, type, value: "" };
  expect(cases.length).toBeGreaterThan(50);
  for (const { conditions, known, unused, complete } of cases) {
    const found = casesOf(doc, TYPES, conditions);
    expect([found?.known, found?.unused, found?.known && found.gap === undefined], JSON.stringify(conditions)).toEqual([
      known,
      unused,
      complete,
    ]);
  }
});
