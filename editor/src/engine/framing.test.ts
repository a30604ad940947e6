import { Box3, PerspectiveCamera, Vector3 } from "three";
import { expect, it } from "vitest";
import { bestDirection, corners, type FramedView, filled, fitted, marginsOf } from "./framing";

const opening = (width: number, height: number): FramedView => ({
  width,
  height,
  fov: 50,
  margins: marginsOf(width, height),
});
const box = (...[x, y, z, X, Y, Z]: [number, number, number, number, number, number]) =>
  new Box3(new Vector3(x, y, z), new Vector3(X, Y, Z));
/** About the demo cell: an arm, a belt, a tester, two boxes and a camera on a table. */
const CELL = [
  box(-0.5, -0.7, -0.04, 0.9, 0.9, -0.02),
  box(-0.1, -0.1, 0, 0.6, 0.5, 0.45),
  box(0.33, -0.88, 0, 0.47, -0.24, 0.06),
  box(0.42, 0.08, 0, 0.58, 0.22, 0.1),
  box(0.1, 0.42, 0, 0.3, 0.58, 0.04),
  box(-0.25, 0.44, 0, -0.05, 0.6, 0.04),
  box(0.37, -0.39, 0.72, 0.43, -0.33, 0.78),
];

/** Place the points by the camera of three.js, pixels. */
function pixels(points: Vector3[], view: FramedView): Vector3[] {
  const camera = new PerspectiveCamera(view.fov, view.width / view.height, 0.01, 100);
  camera.up.set(0, 0, 1);
  const placed = fitted(points, new Vector3(1, -1, 0.7), view);
  camera.position.copy(placed.position);
  camera.lookAt(placed.target);
  camera.updateMatrixWorld();
  return points.map((point) => {
    const { x, y } = point.clone().project(camera);
    return new Vector3(((x + 1) / 2) * view.width, ((1 - y) / 2) * view.height, 0);
  });
}

it.each([
  [1188, 740],
  [750, 760],
  [390, 600],
  [1830, 1000],
])("all points are inside the margins of a view of %i × %i, and touch two opposite ones", (width, height) => {
  const view = opening(width, height);
  const at = pixels(corners(CELL), view);
  const [left, right] = [Math.min(...at.map((each) => each.x)), Math.max(...at.map((each) => each.x))];
  const [top, bottom] = [Math.min(...at.map((each) => each.y)), Math.max(...at.map((each) => each.y))];
  const { margins } = view;
  const gaps = [
    left - margins.left,
    width - margins.right - right,
    top - margins.top,
    height - margins.bottom - bottom,
  ];
  expect(Math.min(...gaps)).toBeGreaterThan(-0.01);
  const touches = (a: number | undefined, b: number | undefined) => Math.max(a ?? 1, b ?? 1) < 0.01;
  expect(touches(gaps[0], gaps[1]) || touches(gaps[2], gaps[3])).toBe(true);
});

it("the first view fills most of the screen, wide or tall", () => {
  const points = corners(CELL);
  for (const [width, height] of [
    [1188, 740],
    [390, 600],
  ] as const) {
    const view = opening(width, height);
    const direction = bestDirection(points, view);
    expect(direction.z).toBeGreaterThan(0.3);
    expect(filled(points, fitted(points, direction, view), view)).toBeGreaterThan(0.65);
  }
});

it("a table top does not matter unless nothing else is shown", () => {
  const table = CELL.slice(0, 1);
  expect(corners(CELL)).toHaveLength((CELL.length - 1) * 8);
  expect(corners(table)).toHaveLength(8);
  expect(corners([...table, new Box3()])).toHaveLength(8);
});
