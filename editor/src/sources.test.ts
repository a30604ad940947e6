/** Limits of the source files that Biome does not check. */

import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { expect, test } from "vitest";

const LONGEST_LINE = 120;
const LONGEST_FILE = 400;

const FILES = readdirSync(import.meta.dirname, { recursive: true, encoding: "utf8" })
  .filter((name) => /\.tsx?$/.test(name) && !name.endsWith("protocol/types.ts"))
  .map((name) => ({
    name,
    lines: readFileSync(join(import.meta.dirname, name), "utf8")
      .trimEnd()
      .split("\n"),
  }));

test("lines are short", () => {
  const long = FILES.flatMap(({ name, lines }) =>
    lines.flatMap((line, n) => (line.length > LONGEST_LINE ? [`${name}:${n + 1}`] : [])),
  );
  expect(long).toEqual([]);
});

test("files are short", () => {
  const long = FILES.filter(({ lines }) => lines.length > LONGEST_FILE).map(({ name }) => name);
  expect(long).toEqual([]);
});
