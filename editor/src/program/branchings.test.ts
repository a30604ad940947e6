/** The branches that a program can take, for a dry run. */

import { expect, test } from "vitest";
import { branchings, existingChoices } from "./branchings";
import { program, TYPES } from "./testing";

test("branching actions state their branches; a removed branch is not chosen any more", () => {
  const doc = program({ a: "ask", b: "act", c: "act" }, [
    ["START", "a"],
    ["a", "b", "true"],
    ["a", "END", "false"],
    ["b", "c"],
  ]);
  const found = branchings(doc, TYPES);
  expect(found).toEqual([
    {
      id: "a",
      name: "a",
      branches: [
        { to: "b", when: "yes" },
        { to: "END", when: "no" },
      ],
    },
  ]);
  expect(existingChoices(found, { a: "END", b: "c" })).toEqual({ a: "END" });
  expect(existingChoices(found, { a: "c" })).toEqual({});
});
