/** Limits of the source files that Biome does not check, and our own rule for Biome. */

import { spawnSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { expect, test } from "vitest";

const MAX_LINE = 120;
const MAX_FILE = 400;

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
    lines.flatMap((line, n) => (line.length > MAX_LINE ? [`${name}:${n + 1}`] : [])),
  );
  expect(long).toEqual([]);
});

test("files are short", () => {
  const long = FILES.filter(({ lines }) => lines.length > MAX_FILE).map(({ name }) => name);
  expect(long).toEqual([]);
});

/** Return the lines in which Biome finds module-level state. */
function withState(source: string, path = "src/commands/example.ts"): number[] {
  const editor = join(import.meta.dirname, "..");
  const folder = mkdtempSync(join(tmpdir(), "module-state-"));
  try {
    writeFileSync(join(folder, "biome.json"), JSON.stringify({ plugins: [join(editor, "module-state.grit")] }));
    mkdirSync(dirname(join(folder, path)), { recursive: true });
    writeFileSync(join(folder, path), source);
    const biome = join(editor, "node_modules", ".bin", "biome");
    const { stdout } = spawnSync(biome, ["lint", "--reporter=json", "."], { cwd: folder, encoding: "utf8" });
    const { diagnostics } = JSON.parse(stdout) as {
      diagnostics: { category: string; location: { start: { line: number } } }[];
    };
    return diagnostics.filter(({ category }) => category === "plugin").map(({ location }) => location.start.line);
  } finally {
    rmSync(folder, { recursive: true });
  }
}

test("module-level state is refused", () => {
  const refused = [
    "let current: Lease | null = null;",
    "export let number = 1;",
    "const locks = new Map<string, number>();",
    "export const session = new Session();",
    "export const useOwn = create<Record<string, boolean>>(() => ({}));",
    "const entries: string[] = [];",
  ];
  expect(withState(refused.join("\n"))).toEqual(refused.map((_, n) => n + 1));
});

test("constants, scratch values and local variables are allowed", () => {
  const allowed = [
    "const NAMES: ReadonlySet<string> = new Set();",
    "const NONE: readonly string[] = [];",
    'const WORDS = { a: "A" };',
    "const matrix = new Matrix4();",
    "const make = () => { let made = new Map(); return made; };",
  ];
  expect(withState(allowed.join("\n"))).toEqual([]);
  expect(withState("export const store = createStore(initialState);", "src/store/store.ts")).toEqual([]);
});
