/** Models of devices that have no collision shape of their own, built from boxes and cylinders. A separate chunk. */

import {
  type Box3,
  BoxGeometry,
  BufferAttribute,
  type BufferGeometry,
  Color,
  CylinderGeometry,
  SphereGeometry,
} from "three";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";

type Triple = readonly [number, number, number];
/** A box by its size, or a cylinder by radius, length and axis; its middle; its colour. m. */
type Part = { at: Triple; color: number } & ({ box: Triple } | { round: readonly [number, number, "x" | "y" | "z"] });

const BODY = 0xe4e7ea;
const DARK = 0x2b3036;
const METAL = 0xaab2ba;
const GLASS = 0x10151b;
const BLUE = 0x2f6f9f;

const box = (size: Triple, at: Triple, color: number): Part => ({ box: size, at, color });
const round = (radius: number, length: number, axis: "x" | "y" | "z", at: Triple, color: number): Part => ({
  round: [radius, length, axis],
  at,
  color,
});

/** A station whose door is open, around a nest at its origin. */
const MACHINE: Part[] = [
  box([0.19, 0.17, 0.06], [0, 0, -0.02], BODY),
  box([0.19, 0.004, 0.03], [0, -0.086, -0.02], BLUE),
  box([0.12, 0.1, 0.012], [0, 0, 0.016], DARK),
  box([0.1, 0.08, 0.004], [0, 0, 0.024], METAL),
  box([0.18, 0.012, 0.13], [0, 0.082, 0.075], BODY),
  box([0.12, 0.004, 0.08], [0, 0.075, 0.08], GLASS),
  round(0.006, 0.19, "x", [0, 0.082, 0.01], METAL),
  box([0.03, 0.004, 0.014], [-0.065, -0.088, -0.02], GLASS),
];

/** By the icon of the object type. The z axis of a camera is its line of sight. */
const MODELS: Record<string, Part[]> = {
  machine: MACHINE,
  camera: [
    box([0.11, 0.032, 0.02], [0, 0, -0.012], METAL),
    box([0.104, 0.028, 0.004], [0, 0, 0], DARK),
    round(0.009, 0.006, "z", [0, 0, 0.004], GLASS),
    round(0.006, 0.005, "z", [-0.04, 0, 0.003], GLASS),
    round(0.006, 0.005, "z", [0.04, 0, 0.003], GLASS),
    round(0.008, 0.05, "z", [0, 0, -0.045], METAL),
  ],
  light: [
    round(0.03, 0.012, "z", [0, 0, 0.006], DARK),
    round(0.008, 0.1, "z", [0, 0, 0.06], METAL),
    round(0.022, 0.038, "z", [0, 0, 0.13], 0xf2f4f5),
    round(0.022, 0.038, "z", [0, 0, 0.17], 0x2f9e58),
    round(0.022, 0.038, "z", [0, 0, 0.21], 0xe6a117),
    round(0.022, 0.038, "z", [0, 0, 0.25], 0xcc3328),
    round(0.022, 0.008, "z", [0, 0, 0.273], DARK),
  ],
  printer: [
    box([0.2, 0.22, 0.1], [0, 0, 0.05], BODY),
    box([0.19, 0.2, 0.05], [0, 0.005, 0.124], DARK),
    box([0.13, 0.01, 0.006], [0, -0.112, 0.06], GLASS),
    box([0.1, 0.05, 0.001], [0, -0.135, 0.058], 0xfafafa),
  ],
  reader: [box([0.05, 0.04, 0.05], [0, 0, 0.025], DARK), box([0.036, 0.004, 0.02], [0, -0.021, 0.03], 0x9b2222)],
  io: [
    box([0.1, 0.06, 0.08], [0, 0, 0.04], BODY),
    box([0.1, 0.004, 0.02], [0, -0.031, 0.065], BLUE),
    box([0.094, 0.01, 0.018], [0, -0.034, 0.02], 0x3d8b5a),
  ],
  scale: [
    box([0.2, 0.24, 0.05], [0, 0, 0.025], BODY),
    round(0.08, 0.008, "z", [0, 0.03, 0.06], METAL),
    box([0.1, 0.03, 0.004], [0, -0.095, 0.051], GLASS),
  ],
  gripper: [
    round(0.032, 0.012, "z", [0, 0, 0.006], METAL),
    box([0.09, 0.05, 0.06], [0, 0, 0.042], DARK),
    box([0.014, 0.024, 0.06], [-0.03, 0, 0.1], METAL),
    box([0.014, 0.024, 0.06], [0.03, 0, 0.1], METAL),
  ],
  suction: [
    round(0.03, 0.02, "z", [0, 0, 0.01], METAL),
    round(0.012, 0.06, "z", [0, 0, 0.05], DARK),
    round(0.02, 0.012, "z", [0, 0, 0.085], 0x3b6b8f),
  ],
  axis: [
    box([0.6, 0.12, 0.03], [0, 0, 0.035], METAL),
    box([0.6, 0.1, 0.006], [0, 0, 0.052], DARK),
    round(0.022, 0.11, "y", [-0.3, 0, 0.034], DARK),
    round(0.022, 0.11, "y", [0.3, 0, 0.034], DARK),
    box([0.02, 0.1, 0.02], [-0.25, 0, 0.01], METAL),
    box([0.02, 0.1, 0.02], [0.25, 0, 0.01], METAL),
  ],
};

/**
 * Return the model for an icon of an object type with its colours; null if there is none. `userData.top` is the height
 * of its surface above its origin, m.
 */
export function modelOf(icon: string): BufferGeometry | null {
  const parts = MODELS[icon];
  if (!parts) return null;
  let top = 0;
  const whole = coloured(
    parts.map((part) => {
      const [x, y, z] = part.at;
      const geometry = ("box" in part ? new BoxGeometry(...part.box) : tube(...part.round)).translate(x, y, z);
      geometry.computeBoundingBox();
      const { min, max } = geometry.boundingBox as Box3;
      if (min.x <= 0 && max.x >= 0 && min.y <= 0 && max.y >= 0) top = Math.max(top, max.z);
      return [geometry, part.color];
    }),
  );
  whole.userData.top = top;
  return whole;
}

/** Return a cylinder along an axis. */
export function tube(radius: number, length: number, axis: "x" | "y" | "z"): BufferGeometry {
  const upright = new CylinderGeometry(radius, radius, length, 24);
  return axis === "y" ? upright : axis === "z" ? upright.rotateX(Math.PI / 2) : upright.rotateZ(Math.PI / 2);
}

/** Return geometries as one, each in its colour. */
export function coloured(parts: readonly (readonly [BufferGeometry, number])[]): BufferGeometry {
  const pieces = parts.map(([geometry, hex]) => {
    const { r, g, b } = new Color(hex);
    const count = geometry.getAttribute("position").count;
    const colors = new Float32Array(count * 3);
    for (let n = 0; n < count; n++) colors.set([r, g, b], 3 * n);
    geometry.deleteAttribute("uv");
    return geometry.setAttribute("color", new BufferAttribute(colors, 3));
  });
  const whole = mergeGeometries(pieces);
  for (const piece of pieces) piece.dispose();
  return whole;
}

/** Return a ball with few triangles. */
export const ball = (radius: number): BufferGeometry => new SphereGeometry(radius, 18, 10);
