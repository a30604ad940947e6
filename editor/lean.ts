/** Leaves out of the build what libraries carry along and nobody needs here. Whoever needs it takes it out of the lists. */

import type { Plugin } from "vitest/config";

/** Shaders of materials and shadows that the engine does not use: physical, toon, matcap, points, of lamps; and backgrounds that are pictures. */
const UNUSED =
  /\/three\/src\/renderers\/shaders\/Shader(Lib\/(meshphysical|meshnormal|distance|vsm|meshtoon|meshmatcap|meshphong|points|background|backgroundCube|cube|equirect)|Chunk\/(lights_physical_\w+|lights_toon_\w+|lights_phong_\w+|transmission_\w+|iridescence_\w+|clearcoat_\w+|cube_uv_reflection_fragment|envmap_physical_pars_fragment|bsdfs_physical|tonemapping_\w+|gradientmap_\w+|map_particle_\w+|normalmap_pars_fragment))\.glsl\.js$/;

/** Parts of three.js that the engine never calls, and what the renderer asks of them. */
const PARTS: Readonly<Record<string, string>> = {
  "extras/PMREMGenerator.js": "export class PMREMGenerator {}",
  "renderers/shaders/DFGLUTData.js": "export const getDFGLUT = () => null;",
  // AR in the browser: comes back with it.
  "renderers/webxr/WebXRManager.js": `export class WebXRManager {
    enabled = false; isPresenting = false;
    addEventListener() {} removeEventListener() {} setAnimationLoop() {} dispose() {} hasDepthSensing() { return false; }
    getEnvironmentBlendMode() { return "opaque"; }
  }`,
  "renderers/webgl/WebGLUniformsGroups.js": "export class WebGLUniformsGroups { bind() {} update() {} dispose() {} }",
  "renderers/webgl/WebGLOutput.js": "export class WebGLOutput {}",
  "renderers/webgl/WebGLEnvironments.js":
    "export class WebGLEnvironments { get(texture) { return texture ?? null; } dispose() {} }",
  "renderers/webgl/WebGLMorphtargets.js": "export class WebGLMorphtargets { update() {} }",
  "renderers/WebGLCubeRenderTarget.js": "export class WebGLCubeRenderTarget {}",
  // Lines of the logic are of this kind; the others would be read from files.
  "extras/curves/Curves.js": "export { QuadraticBezierCurve3 } from './QuadraticBezierCurve3.js';",
};

/** What is never defined in a shader, since no material, mesh or light of ours asks for it. */
const NEVER = new RegExp(
  `^(USE_(${[
    "TANGENT|SPECULAR\\w*|TRANSMISSION\\w*|ROUGHNESSMAP|METALNESSMAP|IRIDESCENCE\\w*|EMISSIVEMAP|CLEARCOAT\\w*|AOMAP",
    "SHEEN\\w*|RETROREFLECTION|REVERSED_DEPTH_BUFFER|SKINNING|NORMALMAP\\w*|LIGHTMAP|DISPLACEMENTMAP|BUMPMAP|BATCHING\\w*",
    "ALPHAHASH|DIFFUSE_ROUGHNESS\\w*|ANISOTROPY\\w*|ENVMAP|LOGARITHMIC_DEPTH_BUFFER|MORPH\\w+|INSTANCING_MORPH|DISPERSION",
    "THICKNESSMAP|GRADIENTMAP|MATCAP|POINTS_UV|LIGHT_PROBES",
  ].join("|")})|STANDARD|PHYSICAL|TOON|PHONG|MATCAP|ENV_WORLDPOS|FOG_EXP2|SHADOWMAP_TYPE_VSM|TONE_MAPPING|IOR)$`,
);
const NONE = /^NUM_(CLIPPING_PLANES|SUN_LIGHT\w*|SPOT_LIGHT\w*|POINT_LIGHT\w*|RECT_AREA_LIGHTS|LIGHT_PROBE_GRIDS) > 0$/;

/** Whether a term of a condition is false for certain. */
function isFalse(term: string): boolean {
  const bare = term
    .trim()
    .replace(/^\(\s*(?!.*\).*\()(.*?)\s*\)$/, "$1")
    .trim();
  const asked = /^defined\s*\(?\s*(\w+)\s*\)?$/.exec(bare);
  return asked?.[1] ? NEVER.test(asked[1]) : NONE.test(bare);
}

/** What of a block stays: all, its `#else`, or what is in it, without the question. */
function outcome(line: string): "all" | "else" | "body" {
  const named = /^#(ifdef|ifndef)\s+(\w+)/.exec(line);
  if (named?.[2]) return !NEVER.test(named[2]) ? "all" : named[1] === "ifdef" ? "else" : "body";
  const condition = line.replace(/^#if\s+/, "").replace(/\/\/.*$/, "");
  const and = condition.includes("&&");
  if (and && condition.includes("||")) return "all";
  const terms = condition.split(and ? "&&" : "||");
  return (and ? terms.some(isFalse) : terms.every(isFalse)) ? "else" : "all";
}

/** Give a shader without the blocks for what is never defined, without comments and indentation. */
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

/** A block with several questions is left alone. */
function hasElif(lines: readonly string[], from: number): boolean {
  let depth = 0;
  for (const line of lines.slice(from)) {
    if (/^#if/.test(line)) depth++;
    else if (line.startsWith("#endif") && --depth === 0) return false;
    else if (line.startsWith("#elif") && depth === 1) return true;
  }
  return false;
}

/** The plugin. Words of react-aria in other languages than the editor's own go, too. */
export function lean(): Plugin {
  return {
    name: "lean",
    apply: "build",
    enforce: "pre",
    resolveId(source, importer) {
      // The server reads meshes: the readers that come with that of URDF are never used.
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
      if (/\/intl\/.*\/[a-z]{2}-[A-Z]{2}\.m?js$/.test(id) && !id.includes("en-US")) return "export default {};";
      return null;
    },
  };
}
