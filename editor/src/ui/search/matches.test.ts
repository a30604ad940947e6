/** Results of the search, and their order. */

import { expect, test } from "vitest";
import { type Entry, found } from "./matches";

const entry = (id: string, words: string, detail = "command"): Entry => ({ id, words, detail, why: "", act: () => {} });
const ALL = [
  entry("undo", "Undo the move of pick"),
  entry("pick", "pick", "action"),
  entry("robot", "arm_left", "UR5e"),
  entry("go", "Go online"),
];
const ids = (search: string, recent: string[] = []) => found(ALL, search, recent).map((each) => each.id);

test("every word has to match the name or kind, and prefix matches come first", () => {
  expect(ids("pick")).toEqual(["pick", "undo"]);
  expect(ids("ur5")).toEqual(["robot"]);
  expect(ids("ONLINE go")).toEqual(["go"]);
  expect(ids("pick online")).toEqual([]);
});

test("without a text, recently used entries come first, and missing ones are left out", () => {
  expect(ids(" ", ["go", "deleted"])).toEqual(["go", "undo", "pick", "robot"]);
});

test("the number of results is limited", () => {
  const many = Array.from({ length: 500 }, (_, number) => entry(`${number}`, `point ${number}`));
  expect(found(many, "point", []).length).toBeLessThan(50);
});
