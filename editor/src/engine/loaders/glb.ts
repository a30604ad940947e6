/** Read the binary glTF that the server creates from meshes and robots (docs/protocol.md), and only that. */

import { t } from "@lingui/core/macro";
import { BufferAttribute, BufferGeometry } from "three";

/** Extras of a robot: its URDF, the meshes of its files, and the reasons for missing ones. */
interface RobotExtras {
  urdf: string;
  meshes: Record<string, string>;
  problems: Record<string, string>;
}

export interface Shown {
  /** By file name, in m, z up. */
  meshes: Map<string, BufferGeometry>;
  extras: Partial<RobotExtras>;
}

interface Accessor {
  bufferView: number;
  componentType: 5120 | 5123 | 5125 | 5126;
  count: number;
  type: "SCALAR" | "VEC3" | "VEC4";
  normalized?: boolean;
}

interface GltfJson {
  scenes: { extras?: Partial<RobotExtras> }[];
  meshes?: { name: string; primitives: { attributes: Record<string, number>; indices: number }[] }[];
  accessors?: Accessor[];
  bufferViews?: { byteOffset: number; byteLength: number; byteStride?: number }[];
}

const ARRAYS = { 5120: Int8Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };
const SIZES = { SCALAR: 1, VEC3: 3, VEC4: 4 };
const NAMES = { POSITION: "position", NORMAL: "normal", COLOR_0: "color" } as const;

/** Read a file; throw if it is invalid. The geometries share the memory of the file. */
export function readGlb(content: ArrayBuffer): Shown {
  const head = new DataView(content);
  if (content.byteLength < 20 || head.getUint32(0, true) !== 0x46546c67)
    throw new Error(t`The model is not a binary glTF file.`);
  const length = head.getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(new Uint8Array(content, 20, length))) as GltfJson;
  const start = 20 + length + 8;

  const attribute = (number: number): BufferAttribute => {
    // biome-ignore lint/correctness/noUnsafeOptionalChaining: a damaged file throws, and is reported.
    const { bufferView, componentType, count, type, normalized } = json.accessors?.[number] as Accessor;
    // biome-ignore lint/correctness/noUnsafeOptionalChaining: a damaged file throws, and is reported.
    const { byteOffset, byteStride } = json.bufferViews?.[bufferView] as { byteOffset: number; byteStride?: number };
    const kind = ARRAYS[componentType];
    // Padded attributes keep their padding: shaders ignore it.
    const size = byteStride ? byteStride / kind.BYTES_PER_ELEMENT : SIZES[type];
    return new BufferAttribute(new kind(content, start + byteOffset, count * size), size, normalized);
  };

  const meshes = new Map<string, BufferGeometry>();
  for (const { name, primitives } of json.meshes ?? []) {
    const [primitive] = primitives;
    if (!primitive) continue;
    const geometry = new BufferGeometry();
    for (const [key, its] of Object.entries(NAMES)) {
      const number = primitive.attributes[key];
      if (number !== undefined) geometry.setAttribute(its, attribute(number));
    }
    meshes.set(name, geometry.setIndex(attribute(primitive.indices)));
  }
  return { meshes, extras: json.scenes[0]?.extras ?? {} };
}

/** Return the only mesh of an asset that is not a robot. */
export function readMesh(content: ArrayBuffer): BufferGeometry {
  const [mesh] = readGlb(content).meshes.values();
  if (!mesh) throw new Error(t`The model contains no surface.`);
  return mesh;
}
