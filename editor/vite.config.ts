/** Build of the editor into the server's static files, with gzip and brotli copies of text files. */

import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { brotliCompressSync, constants, gzipSync } from "node:zlib";
import { lingui } from "@lingui/vite-plugin";
import react from "@vitejs/plugin-react";
import { defineConfig, type Plugin } from "vitest/config";
import { lean } from "./lean.ts";

const OUT = join(import.meta.dirname, "../server/arcor2_server/editor_files");
const SERVER = process.env.ARCOR2_HW_URL ?? "http://127.0.0.1:6789";

/** Compression at build time is denser, and the server need not compress. */
function compressed(): Plugin {
  let out = OUT;
  return {
    name: "compressed",
    apply: "build",
    configResolved({ root, build }) {
      out = resolve(root, build.outDir);
    },
    closeBundle() {
      for (const entry of readdirSync(out, { recursive: true, withFileTypes: true })) {
        const path = join(entry.parentPath, entry.name);
        if (!entry.isFile() || !/\.(js|css|svg|json)$/.test(entry.name)) continue;
        const content = readFileSync(path);
        writeFileSync(`${path}.gz`, gzipSync(content, { level: 9 }));
        writeFileSync(`${path}.br`, brotliCompressSync(content, { params: { [constants.BROTLI_PARAM_QUALITY]: 11 } }));
      }
    },
  };
}

/** Leave the chunks of the shell, which are loaded before any other, out of the dependencies that lazy chunks preload. */
function preloadWithoutShell(): Plugin {
  const shell = new Set<string>();
  return {
    name: "preload-without-shell",
    apply: "build",
    config: () => ({
      build: {
        modulePreload: {
          polyfill: false,
          resolveDependencies: (_, names, { hostType }) =>
            hostType === "html" ? names : names.filter((name) => !shell.has(name)),
        },
      },
    }),
    generateBundle: {
      order: "pre", // before Vite writes the dependencies
      handler(_, bundle) {
        const add = (name: string) => {
          const chunk = bundle[name];
          if (chunk?.type !== "chunk" || shell.has(name)) return;
          shell.add(name);
          for (const style of chunk.viteMetadata?.importedCss ?? []) shell.add(style);
          chunk.imports.forEach(add);
        };
        for (const chunk of Object.values(bundle)) if (chunk.type === "chunk" && chunk.isEntry) add(chunk.fileName);
      },
    },
  };
}

export default defineConfig({
  base: "/editor/",
  plugins: [
    lingui({ macroTransform: true, failOnCompileError: true }),
    react(),
    lean(),
    preloadWithoutShell(),
    compressed(),
  ],
  // From its sources, so that unused parts are left out.
  resolve: { alias: [{ find: /^three$/, replacement: "three/src/Three.js" }] },
  build: {
    outDir: OUT,
    rolldownOptions: { input: ["index.html", "fleet.html"] },
    emptyOutDir: true,
    manifest: true,
    target: "es2022",
    assetsInlineLimit: 0,
    reportCompressedSize: true,
  },
  server: {
    proxy: {
      "/assets": SERVER,
      "/api": SERVER,
      "/project/publish": SERVER,
      "/ws": { target: SERVER, ws: true },
    },
  },
  test: {
    environment: "node",
    include: ["src/**/*.test.ts"],
    setupFiles: ["src/i18n/testing.ts"],
    // One process imports the sources once for all files, instead of each file again.
    isolate: false,
    // For a test that hangs. On a busy machine any test may take long.
    testTimeout: 60_000,
  },
});
