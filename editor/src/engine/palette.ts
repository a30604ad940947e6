/** Colours of the 3D view, light and dark. */

import { Color } from "three";

export interface Palette {
  background: Color;
  /** Lines of the floor: each 50 cm, each 10 cm; and strong ones for edges and numbers. */
  grid: Color;
  gridFine: Color;
  gridStrong: Color;
  axisX: Color;
  axisY: Color;
  object: Color;
  robot: Color;
  selected: Color;
  locked: Color;
  fault: Color;
  point: Color;
  breakpoint: Color;
  running: Color;
  start: Color;
  end: Color;
  /** Colours of connections by branch; dashes and labels distinguish them too. */
  link: Record<"always" | "true" | "false" | "value" | "error", Color>;
  reach: Record<"reachable" | "near_limit" | "in_collision" | "out_of_reach" | "unknown", Color>;
  /** Colours of actions by object. */
  actions: Color[];
}

const color = (hex: number) => new Color(hex);

// Wong's palette, which people with colour vision deficiencies can distinguish.
const ACTIONS = [0x0072b2, 0x009e73, 0xcc79a7, 0x56b4e9, 0xe69f00, 0x8a6fc0, 0x5f7a1e, 0xb0522d].map(color);

const COMMON = {
  selected: color(0xff9500),
  locked: color(0x8a8f98),
  fault: color(0xd5392b),
  breakpoint: color(0xc4161c),
  running: color(0xc13bd6),
  start: color(0x1f8a4c),
  end: color(0x9b2c2c),
  reach: {
    reachable: color(0x1f9d63),
    near_limit: color(0xc98a00),
    in_collision: color(0xb2459c),
    out_of_reach: color(0xd5392b),
    unknown: color(0x8a8f98),
  },
  actions: ACTIONS,
};

export const LIGHT: Palette = {
  ...COMMON,
  background: color(0xeef1f4),
  grid: color(0xc9d1d9),
  gridFine: color(0xdde2e7),
  gridStrong: color(0x8b98a5),
  axisX: color(0xc8524a),
  axisY: color(0x4c9a5a),
  object: color(0x9fb3c4),
  robot: color(0xdfe4ea),
  point: color(0x1d5f8a),
  link: {
    always: color(0x4a5663),
    true: color(0x0b7a4b),
    false: color(0xc05a00),
    value: color(0x3d5bb8),
    error: color(0xc4161c),
  },
};

export const DARK: Palette = {
  ...COMMON,
  background: color(0x14181d),
  grid: color(0x2e3741),
  gridFine: color(0x1f262d),
  gridStrong: color(0x5b6875),
  axisX: color(0xb34d47),
  axisY: color(0x3f8a50),
  object: color(0x5c7186),
  robot: color(0xb9c2cc),
  point: color(0x6fbcec),
  link: {
    always: color(0x9aa7b4),
    true: color(0x47c68c),
    false: color(0xf0913a),
    value: color(0x8ea8ff),
    error: color(0xff6b62),
  },
};
