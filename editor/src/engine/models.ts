/**
 * Models of devices that have no collision shape of their own, built from boxes and cylinders. Their moving parts and
 * lamps follow the reported values. A separate chunk.
 */

import {
  type Box3,
  BoxGeometry,
  BufferAttribute,
  type BufferGeometry,
  Color,
  CylinderGeometry,
  type Object3D,
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

/** A station around a nest at its origin; its door is a moving part. */
const MACHINE: Part[] = [
  box([0.19, 0.17, 0.06], [0, 0, -0.02], BODY),
  box([0.19, 0.004, 0.03], [0, -0.086, -0.02], BLUE),
  box([0.12, 0.1, 0.012], [0, 0, 0.016], DARK),
  box([0.1, 0.08, 0.004], [0, 0, 0.024], METAL),
  box([0.18, 0.012, 0.03], [0, 0.082, 0.02], BODY),
  round(0.006, 0.19, "x", [0, 0.082, 0.038], METAL),
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
  light: [round(0.03, 0.012, "z", [0, 0, 0.006], DARK), round(0.008, 0.1, "z", [0, 0, 0.06], METAL)],
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
  gripper: [round(0.032, 0.012, "z", [0, 0, 0.006], METAL), box([0.05, 0.12, 0.05], [0, 0, 0.037], DARK)],
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

/** A part of a model that moves by a value: door, belt, finger. */
interface Mover {
  value: string;
  parts: Part[];
  /** Origin of its parts in the frame of the model, m. */
  pivot: Triple;
  /** Value while none is reported. */
  unknown: number;
  /** Change of the drawn value per second until it has the reported one; 0: the reported value is a speed. */
  speed: number;
  pose: (part: Object3D, at: number, pivot: Triple) => void;
}

/** Distance of the marks on a belt, m, and their colours. */
const PITCH = 0.1;
const RUNNING = 0xf2f4f6;
const STOPPED = 0x666e76;
const MARKS = [0, 1, 2, 3, 4, 5].map((n) => box([0.012, 0.09, 0.002], [-0.29 + n * PITCH, 0, 0.0555], STOPPED));
const finger = (side: 1 | -1): Mover => ({
  value: "width",
  parts: [box([0.024, 0.014, 0.088], [0, 0.007 * side, 0.106], METAL)],
  pivot: [0, 0, 0],
  unknown: 0.09,
  speed: 0.15,
  pose: (part, at) => part.position.setY((side * at) / 2),
});
const MOVERS: Record<string, Mover[]> = {
  machine: [
    {
      value: "door",
      parts: [box([0.18, 0.012, 0.13], [0, 0, 0.065], BODY), box([0.12, 0.016, 0.08], [0, 0, 0.07], GLASS)],
      pivot: [0, 0.082, 0.04],
      unknown: 1,
      speed: 1.5,
      // The door is upright when it is open, and lies on the nest when it is closed.
      pose: (part, at) => part.rotation.set(((1 - at) * Math.PI) / 2, 0, 0),
    },
  ],
  axis: [
    {
      value: "velocity",
      parts: MARKS,
      pivot: [0, 0, 0],
      unknown: 0,
      speed: 0,
      pose: (part, at) => part.position.setX(at - PITCH * Math.floor(at / PITCH)),
    },
  ],
  gripper: [finger(1), finger(-1)],
};

/** Colours of the lamps, from the lowest to the highest. */
const LAMPS: Record<string, number> = {
  white: 0xffffff,
  blue: 0x3d8bff,
  green: 0x2fe070,
  amber: 0xffb020,
  red: 0xff3a2c,
};
/** Brightness of a lamp that is off, relative to one that is lit. */
const UNLIT = 0.3;
const USUAL = ["white", "green", "amber", "red"];

/** Return the names of the lamps among reported values; the usual ones if none is reported. */
export function lampsOf(values: Values | undefined): string[] {
  const fitted = Object.keys(LAMPS).filter((name) => values?.[name] !== undefined);
  return fitted.length > 0 ? fitted : USUAL;
}

export type Values = Readonly<Record<string, number>>;

/** The model of a device: its body, and parts that follow what it reports. */
export class DeviceModel {
  readonly body: BufferGeometry;
  /** Height of its surface above its origin, m. */
  readonly top: number = 0;
  /** Distance of its farthest part from its origin along z, m. */
  readonly length: number = 0;
  /** Moving parts with their geometry, and the object that draws it. */
  readonly moving: { mover: Mover; geometry: BufferGeometry; object: Object3D | null; at: number }[];
  /** Lamps with the vertices of the body that show them. */
  private readonly lamps: { name: string; first: number; count: number }[] = [];
  private values: Values = {};

  constructor(
    private readonly icon: string,
    parts: readonly Part[],
    lamps: readonly string[],
  ) {
    const pieces = parts.map(pieceOf);
    for (const [geometry] of pieces) {
      const { min, max } = geometry.boundingBox as Box3;
      if (min.x <= 0 && max.x >= 0 && min.y <= 0 && max.y >= 0) this.top = Math.max(this.top, max.z);
    }
    if (icon === "light") {
      let first = pieces.reduce((sum, [each]) => sum + each.getAttribute("position").count, 0);
      lamps.forEach((name, n) => {
        const piece = pieceOf(round(0.022, 0.038, "z", [0, 0, 0.13 + 0.04 * n], LAMPS[name] ?? BODY));
        const count = piece[0].getAttribute("position").count;
        this.lamps.push({ name, first, count });
        first += count;
        pieces.push(piece);
      });
      this.top = 0.117 + 0.04 * lamps.length;
      pieces.push(pieceOf(round(0.022, 0.008, "z", [0, 0, this.top - 0.004], DARK)));
    }
    const movers = MOVERS[icon] ?? [];
    const all = [...pieces, ...movers.flatMap((mover) => mover.parts.map(pieceOf))];
    this.length = Math.max(...all.map(([each]) => (each.boundingBox as Box3).max.z));
    this.body = coloured(pieces);
    this.moving = movers.map((mover) => ({
      mover,
      geometry: coloured(mover.parts.map(pieceOf)),
      object: null,
      at: mover.unknown,
    }));
    this.show({});
  }

  /** Return whether it has the lamps that are reported. */
  fits(values: Values): boolean {
    return this.icon !== "light" || lampsOf(values).join() === this.lamps.map(({ name }) => name).join();
  }

  /** Show reported values: lamps at once, moving parts by `step`. */
  show(values: Values): void {
    this.values = values;
    const colors = this.body.getAttribute("color");
    for (const { name, first, count } of this.lamps) {
      const { r, g, b } = new Color(LAMPS[name]).multiplyScalar(values[name] ? 1 : UNLIT);
      for (let n = first; n < first + count; n++) colors.setXYZ(n, r, g, b);
      colors.needsUpdate = true;
    }
    for (const { mover, geometry } of this.moving) {
      if (mover.speed !== 0) continue;
      const { r, g, b } = new Color(values[mover.value] ? RUNNING : STOPPED);
      const shown = geometry.getAttribute("color");
      for (let n = 0; n < shown.count; n++) shown.setXYZ(n, r, g, b);
      shown.needsUpdate = true;
    }
  }

  /** Move the parts for a time, s; Infinity: to their reported positions. Return whether they move further. */
  step(seconds: number): boolean {
    let more = false;
    for (const part of this.moving) {
      const { value, unknown, speed, pose, pivot } = part.mover;
      const wanted = this.values[value] ?? unknown;
      if (speed === 0) {
        if (Number.isFinite(seconds)) part.at += wanted * seconds;
        more ||= wanted !== 0;
      } else {
        const most = speed * seconds;
        part.at += Math.min(most, Math.max(-most, wanted - part.at));
        more ||= part.at !== wanted;
      }
      if (part.object) {
        part.object.position.set(...pivot);
        pose(part.object, part.at, pivot);
      }
    }
    return more;
  }
}

/** Return the model for an icon of an object type; null if there is none. `lamps`: those of a tower light. */
export function modelOf(icon: string, lamps: readonly string[] = USUAL): DeviceModel | null {
  const parts = MODELS[icon];
  return parts ? new DeviceModel(icon, parts, lamps) : null;
}

function pieceOf(part: Part): [BufferGeometry, number] {
  const geometry = ("box" in part ? new BoxGeometry(...part.box) : tube(...part.round)).translate(...part.at);
  geometry.computeBoundingBox();
  return [geometry, part.color];
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
