/**
 * Leave unused parts of libraries out of the build. Remove an entry from the lists when the editor starts to use it.
 */

import type { Plugin } from "vitest/config";

/** Shaders of materials and shadows that the engine does not use. */
const LIBRARY =
  "meshphysical|meshnormal|distance|vsm|meshtoon|meshmatcap|meshphong|points|background|backgroundCube|cube|equirect";
const CHUNKS = [
  "lights_physical_\\w+|lights_toon_\\w+|lights_phong_\\w+|transmission_\\w+|iridescence_\\w+|clearcoat_\\w+",
  "cube_uv_reflection_fragment|envmap_physical_pars_fragment|bsdfs_physical|tonemapping_\\w+|gradientmap_\\w+",
  "map_particle_\\w+|normalmap_pars_fragment",
].join("|");
const UNUSED = new RegExp(`/three/src/renderers/shaders/Shader(Lib/(${LIBRARY})|Chunk/(${CHUNKS}))\\.glsl\\.js$`);

/** Modules of three.js that the engine never calls, with the stubs that the renderer needs. */
const PARTS: Readonly<Record<string, string>> = {
  "extras/PMREMGenerator.js": "export class PMREMGenerator {}",
  "renderers/shaders/DFGLUTData.js": "export const getDFGLUT = () => null;",
  // AR draws into the framebuffer of its session by itself: src/ar/xrView.ts.
  "renderers/webxr/WebXRManager.js": `export class WebXRManager {
    enabled = false; isPresenting = false;
    addEventListener() {} removeEventListener() {} setAnimationLoop() {} dispose() {}
    hasDepthSensing() { return false; }
    getEnvironmentBlendMode() { return "opaque"; }
  }`,
  "renderers/webgl/WebGLClipping.js": `export class WebGLClipping {
    uniform = { value: null, needsUpdate: false }; numPlanes = 0; numIntersection = 0;
    init() { return false; } beginShadows() {} endShadows() {} setGlobalState() {} setState() {}
  }`,
  "math/FrustumArray.js": "export class FrustumArray {}",
  "renderers/webgl/WebGLUniformsGroups.js": "export class WebGLUniformsGroups { bind() {} update() {} dispose() {} }",
  "renderers/webgl/WebGLOutput.js": "export class WebGLOutput {}",
  "renderers/webgl/WebGLEnvironments.js":
    "export class WebGLEnvironments { get(texture) { return texture ?? null; } dispose() {} }",
  "renderers/webgl/WebGLMorphtargets.js": "export class WebGLMorphtargets { update() {} }",
  "renderers/WebGLCubeRenderTarget.js": "export class WebGLCubeRenderTarget {}",
  // Curve of the program steps; the others are only used by file loaders.
  "extras/curves/Curves.js": "export { QuadraticBezierCurve3 } from './QuadraticBezierCurve3.js';",
};

/** Macros that no material, mesh or light of the editor defines. */
const NEVER = new RegExp(
  `^(USE_(${[
    "TANGENT|SPECULAR\\w*|TRANSMISSION\\w*|ROUGHNESSMAP|METALNESSMAP|IRIDESCENCE\\w*|EMISSIVEMAP|CLEARCOAT\\w*|AOMAP",
    "SHEEN\\w*|RETROREFLECTION|REVERSED_DEPTH_BUFFER|SKINNING|NORMALMAP\\w*|LIGHTMAP|DISPLACEMENTMAP|BUMPMAP",
    "BATCHING\\w*",
    "ALPHAHASH|DIFFUSE_ROUGHNESS\\w*|ANISOTROPY\\w*|ENVMAP|LOGARITHMIC_DEPTH_BUFFER|MORPH\\w+",
    "INSTANCING_MORPH|DISPERSION",
    "THICKNESSMAP|GRADIENTMAP|MATCAP|POINTS_UV|LIGHT_PROBES",
  ].join("|")})|STANDARD|PHYSICAL|TOON|PHONG|MATCAP|ENV_WORLDPOS|FOG_EXP2|SHADOWMAP_TYPE_VSM|TONE_MAPPING|IOR)$`,
);
const NONE = /^NUM_(CLIPPING_PLANES|SUN_LIGHT\w*|SPOT_LIGHT\w*|POINT_LIGHT\w*|RECT_AREA_LIGHTS|LIGHT_PROBE_GRIDS) > 0$/;

/** The locale of react-aria: the language of the page. */
const LOCALE = `
  export const getDefaultLocale = () => ({ locale: document.documentElement.lang, direction: "ltr" });
  export const useDefaultLocale = getDefaultLocale;
`;

/** Languages of react-aria's texts. */
const TEXTS = /\b(en-US|cs-CZ|de-DE)\b/;

/** Return whether a term of a condition is always false. */
function isFalse(term: string): boolean {
  const bare = term
    .trim()
    .replace(/^\(\s*(?!.*\).*\()(.*?)\s*\)$/, "$1")
    .trim();
  const asked = /^defined\s*\(?\s*(\w+)\s*\)?$/.exec(bare);
  return asked?.[1] ? NEVER.test(asked[1]) : NONE.test(bare);
}

/** Return what remains of a block: everything, its `#else` part, or its body without the condition. */
function outcome(line: string): "all" | "else" | "body" {
  const named = /^#(ifdef|ifndef)\s+(\w+)/.exec(line);
  if (named?.[2]) return !NEVER.test(named[2]) ? "all" : named[1] === "ifdef" ? "else" : "body";
  const condition = line.replace(/^#if\s+/, "").replace(/\/\/.*$/, "");
  const and = condition.includes("&&");
  if (and && condition.includes("||")) return "all";
  const terms = condition.split(and ? "&&" : "||");
  return (and ? terms.some(isFalse) : terms.every(isFalse)) ? "else" : "all";
}

/** Return a shader without blocks of undefined macros, comments and indentation. */
export function leanShader(text: string): string {
  const lines = text
    .replace(/\/\*(?! glsl)[\s\S]*?\*\//g, "")
    .split("\n")
    .map((line) => line.trim())
    .filter((line) => line && !line.startsWith("//"));
  const kept: string[] = [];
  const open: { stays: "all" | "else" | "body"; outer: boolean }[] = [];
  let shown = true;
  lines.forEach((line, at) => {
    const top = open.at(-1);
    if (/^#if/.test(line)) {
      const stays = hasElif(lines, at) ? "all" : outcome(line);
      open.push({ stays, outer: shown });
      if (shown && stays === "all") kept.push(line);
      shown = shown && stays !== "else";
    } else if (line.startsWith("#else") && top && top.stays !== "all") {
      shown = top.outer && top.stays === "else";
    } else if (line.startsWith("#endif") && top) {
      open.pop();
      shown = top.outer;
      if (shown && top.stays === "all") kept.push(line);
    } else if (shown) {
      kept.push(line);
    }
  });
  return kept.join("\n");
}

/** Return whether a block has `#elif`; such blocks are left unchanged. */
function hasElif(lines: readonly string[], from: number): boolean {
  let depth = 0;
  for (const line of lines.slice(from)) {
    if (/^#if/.test(line)) depth++;
    else if (line.startsWith("#endif") && --depth === 0) return false;
    else if (line.startsWith("#elif") && depth === 1) return true;
  }
  return false;
}

/** Return the texts of react-aria in the languages of the editor: a module that imports one file per language. */
export function leanTexts(code: string): string {
  return code
    .split("\n")
    .filter((line) => !/[a-z]{2}-[A-Z]{2}/.test(line) || TEXTS.test(line))
    .join("\n");
}

/** The Vite plugin. It also drops the texts of react-aria in languages that the editor does not have. */
export function lean(): Plugin {
  return {
    name: "lean",
    apply: "build",
    enforce: "pre",
    resolveId(source, importer) {
      // The server converts meshes, so the mesh loaders of urdf-loader are never used.
      return importer?.includes("/urdf-loader/") && /\/(STL|Collada)Loader\.js$/.test(source) ? "\0no-loaders" : null;
    },
    load(id) {
      return id === "\0no-loaders" ? "export class STLLoader {}\nexport class ColladaLoader {}" : null;
    },
    transform(code, id) {
      const part = /\/three\/src\/(.+)$/.exec(id)?.[1] ?? "";
      if (PARTS[part]) return PARTS[part];
      if (UNUSED.test(id)) {
        return part.includes("/ShaderLib/") ? "export const vertex = '', fragment = '';" : "export default '';";
      }
      if (part.startsWith("renderers/shaders/")) return leanShader(code);
      if (/\/intlStrings\.m?js$/.test(id)) return leanTexts(code);
      if (/\/i18n\/useDefaultLocale\.m?js$/.test(id)) return LOCALE;
      return null;
    },
  };
}
