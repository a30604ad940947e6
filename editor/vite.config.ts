/** Build of the editor: into the server's static files, with a gzip and a brotli copy beside each text file. */

import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { brotliCompressSync, constants, gzipSync } from "node:zlib";
import react from "@vitejs/plugin-react";
import { defineConfig, type Plugin } from "vitest/config";

const OUT = join(import.meta.dirname, "../server/arcor2_server/editor_files");
const SERVER = process.env["ARCOR2_HW_URL"] ?? "http://127.0.0.1:6789";

/** Compressing at build time costs the server nothing and is denser than it could afford per request. */
function compressed(): Plugin {
  return {
    name: "compressed",
    apply: "build",
    closeBundle() {
      for (const entry of readdirSync(OUT, { recursive: true, withFileTypes: true })) {
        const path = join(entry.parentPath, entry.name);
        if (!entry.isFile() || !/\.(js|css|svg|json)$/.test(entry.name)) continue;
        const content = readFileSync(path);
        writeFileSync(`${path}.gz`, gzipSync(content, { level: 9 }));
        writeFileSync(`${path}.br`, brotliCompressSync(content, { params: { [constants.BROTLI_PARAM_QUALITY]: 11 } }));
      }
    },
  };
}

/** Shaders of materials that the engine does not use: physical, toon, matcap and points, and backgrounds that are pictures. */
const UNUSED =
  /\/three\/src\/renderers\/shaders\/Shader(Lib\/(meshphysical|meshtoon|meshmatcap|meshphong|points|background|backgroundCube|cube|equirect)|Chunk\/(lights_physical_\w+|lights_toon_\w+|lights_phong_\w+|transmission_\w+|iridescence_\w+|clearcoat_\w+|cube_uv_reflection_fragment|envmap_physical_pars_fragment|bsdfs_physical))\.glsl\.js$/;

/**
 * Leaves out what libraries carry along and nobody needs here: unused shaders and what prepares their light, comments in
 * the others, words in other languages than the editor's own.
 */
function lean(): Plugin {
  return {
    name: "lean",
    apply: "build",
    enforce: "pre",
    transform(code, id) {
      if (UNUSED.test(id)) {
        return id.includes("/ShaderLib/") ? "export const vertex = '', fragment = '';" : "export default '';";
      }
      if (id.endsWith("/three/src/extras/PMREMGenerator.js")) return "export class PMREMGenerator {}";
      if (id.endsWith("/three/src/renderers/shaders/DFGLUTData.js")) return "export const getDFGLUT = () => null;";
      if (/\/three\/src\/renderers\/shaders\/.*\.js$/.test(id)) {
        return code
          .replace(/\/\*(?! glsl)[\s\S]*?\*\//g, "")
          .replace(/^[ \t]*\/\/.*$/gm, "")
          .replace(/^[ \t]+/gm, "")
          .replace(/\n{2,}/g, "\n");
      }
      if (/\/intl\/.*\/[a-z]{2}-[A-Z]{2}\.m?js$/.test(id) && !id.includes("en-US")) return "export default {};";
      return null;
    },
  };
}

export default defineConfig({
  base: "/editor/",
  plugins: [react(), lean(), compressed()],
  // From its sources, so that what is not used of it is left out.
  resolve: { alias: [{ find: /^three$/, replacement: "three/src/Three.js" }] },
  build: {
    outDir: OUT,
    emptyOutDir: true,
    manifest: true,
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    reportCompressedSize: true,
  },
  server: {
    proxy: {
      "/assets": SERVER,
      "/api": SERVER,
      "/ws": { target: SERVER, ws: true },
    },
  },
  test: { environment: "node", include: ["src/**/*.test.ts"] },
});
