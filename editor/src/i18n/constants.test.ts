/** Texts are looked up when they are shown, not when modules are evaluated. */

import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { expect, test } from "vitest";

const SOURCES = join(import.meta.dirname, "..");

test("constants of modules are not translated before the catalogue is loaded", () => {
  const offending: string[] = [];
  for (const name of readdirSync(SOURCES, { recursive: true, encoding: "utf8" })) {
    if (!/\.tsx?$/.test(name) || name.includes(".test.")) continue;
    let inConstant = false;
    for (const line of readFileSync(join(SOURCES, name), "utf8").split("\n")) {
      if (/^\S/.test(line))
        inConstant = /^(export )?(const|let) \w+[^=]*= *(\{|\[|new |[\w(]+`|Object)/.test(line) && !line.includes("=>");
      if (inConstant && /\b(t|plural)[`(]/.test(line) && !line.includes("=>"))
        offending.push(`${name}: ${line.trim()}`);
    }
  }
  expect(offending).toEqual([]);
});
