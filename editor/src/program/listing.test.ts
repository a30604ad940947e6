/** The list of a program, and moves in it. */

import { expect, test } from "vitest";
import { listingOf, type Row } from "./listing";
import { movableRuns, moveOf } from "./moving";
import { program } from "./testing";

const shown = (row: Row): string => {
  const indent = "  ".repeat(row.depth);
  if (row.kind === "action" || row.kind === "lane") return `${indent}${row.id}`;
  if (row.kind === "unreached") return "unreached";
  return `${indent}${row.kind === "branch" ? "?" : ">"} ${row.item.start}-${row.item.end}`;
};
const listed = (kinds: Record<string, string>, steps: [string, string, string?][]) =>
  listingOf(program(kinds, steps)).map(shown);
const acts = (ids: string, rest: Record<string, string> = {}) => ({
  ...Object.fromEntries([...ids].map((id) => [id, "act"])),
  ...rest,
});

test("a straight program has no indentation, and unreached actions come last", () => {
  const steps: [string, string][] = [
    ["b", "END"],
    ["a", "b"],
    ["START", "a"],
  ];
  expect(listed(acts("abx"), steps)).toEqual(["a", "b", "unreached", "x"]);
});

test("branches that join are indented, and their common rest is not", () => {
  expect(
    listed(acts("bcd", { a: "ask" }), [
      ["START", "a"],
      ["a", "b", "true"],
      ["a", "c", "false"],
      ["b", "d"],
      ["c", "d"],
      ["d", "END"],
    ]),
  ).toEqual(["a", "  ? a-b", "    b", "  ? a-c", "    c", "d"]);
});

test("an empty branch names the step at which it continues", () => {
  expect(
    listed(acts("bd", { a: "ask" }), [
      ["START", "a"],
      ["a", "b", "true"],
      ["a", "d", "false"],
      ["b", "d"],
      ["d", "END"],
    ]),
  ).toEqual(["a", "  ? a-b", "    b", "  ? a-d", "    > a-d", "d"]);
});

test("of branches that never join, the longest one is not indented", () => {
  expect(
    listed(acts("bcd", { a: "ask" }), [
      ["START", "a"],
      ["a", "b", "true"],
      ["b", "c"],
      ["c", "END"],
      ["a", "d", "false"],
      ["d", "END"],
    ]),
  ).toEqual(["a", "  ? a-d", "    d", "    > d-END", "? a-b", "b", "c"]);
});

test("error exits are indented after their action and name the step at which they continue", () => {
  expect(
    listed(acts("abcde"), [
      ["START", "a"],
      ["a", "b"],
      ["a", "e", "on refused"],
      ["a", "END", "on error"],
      ["e", "c"],
      ["b", "c"],
      ["c", "d"],
      ["d", "END"],
    ]),
  ).toEqual(["a", "  ? a-e", "    e", "    > e-c", "  ? a-END", "    > a-END", "b", "c", "d"]);
});

test("a large program is listed quickly and completely", () => {
  const count = 10_000;
  const kinds: Record<string, string> = {};
  const steps: [string, string, string?][] = [["START", "a0"]];
  for (let n = 0; n < count; n++) {
    kinds[`a${n}`] = "act";
    steps.push([`a${n}`, n + 1 < count ? `a${n + 1}` : "END"]);
    if (n % 10 === 0 && n + 5 < count) steps.push([`a${n}`, `a${n + 5}`, "on error"]);
  }
  const rows = listingOf(program(kinds, steps));
  expect(rows.filter((row) => row.kind === "action").map((row) => row.id)).toEqual(Object.keys(kinds));
});

const chain = program(acts("abcd", { e: "ask" }), [
  ["START", "a"],
  ["a", "b"],
  ["b", "c"],
  ["c", "e"],
  ["e", "d", "true"],
  ["e", "END", "false"],
  ["d", "END"],
]);

test("an action can be moved among its straight neighbours only", () => {
  expect([...movableRuns(chain)]).toEqual(["a", "b", "c"].map((id) => [id, ["a", "b", "c"]]));
  expect(movableRuns(program(acts("ab"), [["a", "b"]])).size).toBe(0);
});

test("a move redirects the connections around both places", () => {
  expect(moveOf(chain, "a", 2)).toEqual({
    remove: "s1",
    redirect: [
      { id: "s0", end: "b" },
      { id: "s3", end: "a" },
    ],
    add: { start: "a", end: "e" },
  });
  expect(moveOf(chain, "c", 0)).toEqual({
    remove: "s3",
    redirect: [
      { id: "s2", end: "e" },
      { id: "s0", end: "c" },
    ],
    add: { start: "c", end: "a" },
  });
  expect(moveOf(chain, "a", 0)).toMatch("cannot be moved");
});

test("an action is not moved before an action whose result it uses", () => {
  const doc = program(
    { a: "count", b: "count" },
    [
      ["START", "a"],
      ["a", "b"],
      ["b", "END"],
    ],
    { b: { type: "link", value: '"a/default/0"' } },
  );
  expect(moveOf(doc, "b", 0)).toBe("b uses a result of a.");
  expect(moveOf(doc, "a", 1)).toBe("b uses a result of a.");
});
