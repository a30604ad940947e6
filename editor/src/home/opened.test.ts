import { expect, it } from "vitest";
import { idsToForget, recentIds } from "./opened";

it("returns the opened documents, newest first, and no other stored values", () => {
  expect(recentIds({ "opened/a": 1, stars: ["a"], "opened/b": 3, "opened/c": "yesterday", "opened/d": 2 })).toEqual([
    "b",
    "d",
    "a",
  ]);
});

it("forgets the oldest documents, but not the one that is opened", () => {
  const many = Array.from({ length: 52 }, (_, n) => `d${n}`);
  expect(idsToForget(many, "new")).toEqual(["d49", "d50", "d51"]);
  expect(idsToForget(many, "d51")).toEqual(["d49", "d50"]);
  expect(idsToForget(["a"], "a")).toEqual([]);
});
