import { expect, test } from "vitest";
import { quadOf } from "./borders";
import type { Point } from "./geometry";

/** Return the border of a shape with these corners, pixel by pixel, from its second side on. */
function borderOf(corners: readonly Point[]): number[] {
  return corners.flatMap((_, n) => {
    const [from, to] = [corners[(n + 1) % corners.length] as Point, corners[(n + 2) % corners.length] as Point];
    const steps = Math.max(Math.abs(to[0] - from[0]), Math.abs(to[1] - from[1]));
    return Array.from({ length: steps }, (_, k) => [
      Math.round(from[0] + ((to[0] - from[0]) * k) / steps),
      Math.round(from[1] + ((to[1] - from[1]) * k) / steps),
    ]).flat();
  });
}

const sorted = (quad: readonly Point[] | null) => [...(quad ?? [])].sort((a, b) => a[0] - b[0] || a[1] - b[1]);

test.each([
  [
    "square",
    [
      [10, 10],
      [60, 10],
      [60, 60],
      [10, 60],
    ],
  ],
  // The corner that is farthest from another one is next to it, not opposite.
  [
    "skewed",
    [
      [239, 161],
      [271, 165],
      [264, 185],
      [230, 182],
    ],
  ],
  [
    "acute",
    [
      [10, 10],
      [60, 30],
      [110, 90],
      [60, 70],
    ],
  ],
] as [string, Point[]][])("a %s quadrilateral has four corners", (_, corners) => {
  for (let turn = 0; turn < 4; turn++) {
    const turned = [...corners.slice(turn), ...corners.slice(0, turn)];
    expect(sorted(quadOf(borderOf(turned)))).toEqual(sorted(corners));
  }
});

test.each([
  [
    "triangle",
    [
      [10, 10],
      [90, 20],
      [40, 80],
    ],
  ],
  [
    "hexagon",
    [
      [30, 10],
      [60, 10],
      [80, 40],
      [60, 70],
      [30, 70],
      [10, 40],
    ],
  ],
  [
    "line",
    [
      [10, 10],
      [90, 12],
      [90, 11],
    ],
  ],
] as [string, Point[]][])("a %s is not a marker", (_, corners) => {
  expect(quadOf(borderOf(corners))).toBeNull();
});
