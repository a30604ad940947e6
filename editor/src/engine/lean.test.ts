/** Shaders without undefined macros. */

import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { expect, test } from "vitest";
import { leanShader } from "../../lean";

test("blocks of undefined macros are removed, except for their else part; other blocks are unchanged", () => {
  const text = [
    "a",
    "#ifdef USE_SKINNING",
    "  b",
    "  #ifdef USE_MAP",
    "    c",
    "  #else",
    "    d",
    "  #endif",
    "#else",
    "  e",
    "#endif",
    "#ifndef USE_ENVMAP",
    "  f",
    "#else",
    "  g",
    "#endif",
    "#if ( NUM_POINT_LIGHTS > 0 ) && defined( RE_Direct )",
    "  h",
    "#endif",
    "#if defined( USE_MAP ) || defined( USE_BUMPMAP )",
    "  i // said",
    "#endif",
    "#if defined( STANDARD )",
    "  j",
    "#elif defined( USE_COLOR )",
    "  k",
    "#endif",
  ].join("\n");
  expect(leanShader(text).split("\n")).toEqual([
    ...["a", "e", "f", "#if defined( USE_MAP ) || defined( USE_BUMPMAP )", "i // said", "#endif"],
    ...["#if defined( STANDARD )", "j", "#elif defined( USE_COLOR )", "k", "#endif"],
  ]);
});

test("every shader of three.js keeps balanced conditions", () => {
  const root = join(import.meta.dirname, "../../node_modules/three/src/renderers/shaders");
  const files = readdirSync(root, { recursive: true, encoding: "utf8" }).filter((name) => name.endsWith(".glsl.js"));
  expect(files.length).toBeGreaterThan(100);
  for (const name of files) {
    const text = leanShader(readFileSync(join(root, name), "utf8"));
    const count = (what: RegExp) => text.match(what)?.length ?? 0;
    expect([name, count(/^#if/gm), count(/`/g) % 2]).toEqual([name, count(/^#endif/gm), 0]);
  }
});
