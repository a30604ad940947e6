/** Draw pictures of markers as a camera sees them, for tests. */

import { add, apply, area, cross, homography, type Mat3, type Quad, scale, sub, unit, type Vec3 } from "./geometry";
import type { Grey } from "./grey";
import { layoutOf, type MarkerTable } from "./places";
import { type Lens, projected, type View } from "./pose";

/** A sequence of random numbers from 0 to 1, the same in every run. */
export function randomNumbers(seed: number): () => number {
  let state = seed;
  return () => {
    state = (state * 16807) % 2147483647;
    return state / 2147483647;
  };
}

/** Return the view of a camera at `eye` that looks at a point, upright. */
export function looking(eye: Vec3, at: Vec3): View {
  const forward = unit(sub(at, eye));
  const right = unit(cross(forward, [0, 0, 1]));
  const turn: Mat3 = [right, cross(forward, right), forward];
  return { turn, shift: scale(apply(turn, eye), -1) };
}

export interface Drawing {
  width: number;
  height: number;
  lens: Lens;
  view: View;
  /** Standard deviation of the blur, pixels, and of the noise. */
  blur?: number;
  noise?: number;
  /** Brightness of white paper and of black ink. */
  white?: number;
  black?: number;
  /** Something that covers the picture: its grey value at a pixel, or undefined. */
  cover?: (x: number, y: number) => number | undefined;
}

/** Return a picture of the markers of a table. They must not cover each other. */
export function drawn(table: MarkerTable, drawing: Drawing): Grey {
  const { width, height, lens, view, blur = 0.8, noise = 2.5, white = 215, black = 35, cover } = drawing;
  const { places, codes } = layoutOf(table);
  const exact = new Float32Array(width * height).fill(black + (white - black) * 0.45);
  for (const [id, { corners }] of places) {
    const outline = corners.map((corner) => projected(corner, view, lens));
    const [p, q, r] = outline;
    if (!p || !q || !r || outline.includes(null) || area(outline as unknown as Quad) <= 0) continue; // seen from behind
    paint(exact, drawing, codes.get(id) ?? 0, outline as unknown as Quad, white, black);
  }
  if (cover) exact.forEach((value, i) => (exact[i] = cover(i % width, Math.floor(i / width)) ?? value));
  const soft = blurred(blurred(exact, width, height, blur, true), width, height, blur, false);
  const random = randomNumbers(7);
  const noises = Array.from({ length: 4096 }, () => {
    const gauss = Math.sqrt(-2 * Math.log(random() + 1e-9)) * Math.cos(2 * Math.PI * random());
    return noise * gauss;
  });
  const data = new Uint8Array(width * height);
  for (let i = 0; i < data.length; i++) {
    const value = (soft[i] as number) + (noises[(i * 2654435761) >>> 20] as number);
    data[i] = Math.max(0, Math.min(255, Math.round(value)));
  }
  return { data, width, height };
}

/** White margin of a marker, relative to its side. */
const MARGIN = 1 / 6;
const OFFSETS = [-1 / 3, 0, 1 / 3];

/** Paint a marker whose black square has these corners. */
function paint(
  into: Float32Array,
  { width, height }: Drawing,
  code: number,
  outline: Quad,
  white: number,
  black: number,
): void {
  const [a, b, c, d, e, f, g, h] = homography(outline) as unknown as [
    number,
    number,
    number,
    number,
    number,
    number,
    number,
    number,
  ];
  // The inverse, up to a factor, from the picture to the unit square.
  const inverse = [
    e - f * h,
    c * h - b,
    b * f - c * e,
    f * g - d,
    a - c * g,
    c * d - a * f,
    d * h - e * g,
    b * g - a * h,
    a * e - b * d,
  ];
  const [i0, i1, i2, i3, i4, i5, i6, i7, i8] = inverse as [
    number,
    number,
    number,
    number,
    number,
    number,
    number,
    number,
    number,
  ];
  const reach = Math.sqrt(area(outline)) * 0.6;
  const [xs, ys] = [outline.map(([x]) => x), outline.map(([, y]) => y)];
  const [left, right] = [
    Math.max(0, Math.floor(Math.min(...xs) - reach)),
    Math.min(width - 1, Math.max(...xs) + reach),
  ];
  const [top, bottom] = [
    Math.max(0, Math.floor(Math.min(...ys) - reach)),
    Math.min(height - 1, Math.max(...ys) + reach),
  ];
  for (let y = top; y <= bottom; y++) {
    for (let x = left; x <= right; x++) {
      let sum = 0;
      const before = into[y * width + x] as number;
      for (const dy of OFFSETS) {
        for (const dx of OFFSETS) {
          const [px, py] = [x + dx, y + dy];
          const w = i6 * px + i7 * py + i8;
          const u = (i0 * px + i1 * py + i2) / w;
          const v = (i3 * px + i4 * py + i5) / w;
          if (u < -MARGIN || u > 1 + MARGIN || v < -MARGIN || v > 1 + MARGIN) {
            sum += before;
            continue;
          }
          const [column, row] = [Math.floor(u * 6), Math.floor(v * 6)];
          const inside = column > 0 && column < 5 && row > 0 && row < 5;
          const bit = inside && (code >> (15 - ((row - 1) * 4 + column - 1))) & 1;
          sum += u < 0 || u >= 1 || v < 0 || v >= 1 || bit ? white : black;
        }
      }
      into[y * width + x] = sum / 9;
    }
  }
}

/** Blur along rows or columns. */
function blurred(from: Float32Array, width: number, height: number, deviation: number, rows: boolean): Float32Array {
  const reach = Math.ceil(3 * deviation);
  const weights = Float32Array.from({ length: 2 * reach + 1 }, (_, k) =>
    Math.exp(-((k - reach) ** 2) / (2 * deviation ** 2)),
  );
  const total = weights.reduce((a, b) => a + b);
  const step = rows ? 1 : width;
  const last = rows ? width - 1 : height - 1;
  const out = new Float32Array(from.length);
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const place = rows ? x : y;
      const first = y * width + x - place * step;
      let sum = 0;
      for (let k = -reach; k <= reach; k++) {
        const at = Math.max(0, Math.min(last, place + k));
        sum += (weights[k + reach] as number) * (from[first + at * step] as number);
      }
      out[first + place * step] = sum / total;
    }
  }
  return out;
}

/** Return how far from its place the overlay shows a point, m at its distance. */
export function overlayError(point: Vec3, truth: [View, Lens], found: [View, Lens]): number {
  const [a, b] = [truth, found].map(([view, lens]) => {
    const [x, y, z] = add(apply(view.turn, point), view.shift);
    return [(lens.focal * x) / z + lens.cx, (lens.focal * y) / z + lens.cy, z] as const;
  }) as [readonly [number, number, number], readonly [number, number, number]];
  return (Math.hypot(a[0] - b[0], a[1] - b[1]) * a[2]) / truth[1].focal;
}
