import { expect, it } from "vitest";
import { beyond, openedOf } from "./opened";

it("gives what was opened, the last first, and nothing else that is kept", () => {
  expect(openedOf({ "opened/a": 1, stars: ["a"], "opened/b": 3, "opened/c": "yesterday", "opened/d": 2 })).toEqual([
    "b",
    "d",
    "a",
  ]);
});

it("forgets the oldest, and never what is opened again", () => {
  const many = Array.from({ length: 52 }, (_, n) => `d${n}`);
  expect(beyond(many, "new")).toEqual(["d49", "d50", "d51"]);
  expect(beyond(many, "d51")).toEqual(["d49", "d50"]);
  expect(beyond(["a"], "a")).toEqual([]);
});
