/**
 * The handles of the gizmo, and which one is under the pointer. Distances are in pixels, so that fingers can hit them.
 */

import { type Camera, Vector3 } from "three";
import { toSegment } from "./drags";

export type Axis = "x" | "y" | "z";
export const AXES: readonly Axis[] = ["x", "y", "z"];

export type Handle =
  /** Move along an axis, in a plane perpendicular to an axis, or freely. */
  | { kind: "axis"; axis: Axis }
  | { kind: "plane"; axis: Axis }
  | { kind: "free" }
  /** Turn about an axis. */
  | { kind: "ring"; axis: Axis }
  /** Drag a face: the one in the direction of an axis, or opposite to it. */
  | { kind: "face"; axis: Axis; sign: 1 | -1 };

export type GizmoMode = "move" | "turn" | "size";

export const keyOf = (handle: Handle): string =>
  handle.kind === "free"
    ? "free"
    : handle.kind === "face"
      ? `face ${handle.sign > 0 ? "+" : "-"}${handle.axis}`
      : `${handle.kind} ${handle.axis}`;

/** Proportions in lengths of the gizmo: start and end of a shaft, position of a square, radius of a ring. */
export const SHAFT = [0.3, 1.05] as const;
export const SQUARE = [0.34, 0.56] as const;
export const RING = 0.85;

export const UNIT: Record<Axis, Vector3> = {
  x: new Vector3(1, 0, 0),
  y: new Vector3(0, 1, 0),
  z: new Vector3(0, 0, 1),
};

export function handlesOf(mode: GizmoMode, allowed: readonly Axis[]): Handle[] {
  if (mode === "turn") return allowed.map((axis) => ({ kind: "ring", axis }));
  if (mode === "size") {
    return allowed.flatMap((axis) => ([1, -1] as const).map((sign): Handle => ({ kind: "face", axis, sign })));
  }
  return [
    { kind: "free" },
    ...allowed.map((axis): Handle => ({ kind: "axis", axis })),
    ...allowed.map((axis): Handle => ({ kind: "plane", axis })),
  ];
}

/** Return two axes perpendicular to one, in right-handed order. */
export function perpendicular(axis: Axis): [Vector3, Vector3] {
  const at = AXES.indexOf(axis);
  return [UNIT[AXES[(at + 1) % 3] ?? "x"], UNIT[AXES[(at + 2) % 3] ?? "x"]];
}

/** Return the line by which a handle is hit, in lengths of the gizmo and its frame; a point for small handles. */
export function outline(handle: Handle, half: Record<Axis, number>): Vector3[] {
  switch (handle.kind) {
    case "free":
      return [new Vector3()];
    case "axis":
      return SHAFT.map((at) => UNIT[handle.axis].clone().multiplyScalar(at));
    case "plane": {
      const [a, b] = perpendicular(handle.axis);
      const middle = (SQUARE[0] + SQUARE[1]) / 2;
      return [a.clone().multiplyScalar(middle).addScaledVector(b, middle)];
    }
    case "face":
      return [UNIT[handle.axis].clone().multiplyScalar(handle.sign * half[handle.axis])];
    case "ring": {
      const [a, b] = perpendicular(handle.axis);
      return Array.from({ length: 49 }, (_, n) => {
        const angle = (n / 48) * 2 * Math.PI;
        return a
          .clone()
          .multiplyScalar(Math.cos(angle) * RING)
          .addScaledVector(b, Math.sin(angle) * RING);
      });
    }
  }
}

interface OnScreen {
  x: number;
  y: number;
  /** Depth in normalised device coordinates; larger is farther. */
  depth: number;
}

export function onScreen(point: Vector3, camera: Camera, width: number, height: number): OnScreen {
  const at = point.clone().project(camera);
  return { x: ((at.x + 1) / 2) * width, y: ((1 - at.y) / 2) * height, depth: at.z };
}

/** Return the distance of a pointer from a handle's outline on the screen, px; a bit more for its rear half. */
export function distanceToOutline(x: number, y: number, line: OnScreen[], centre: OnScreen): number {
  const [first] = line;
  if (!first || line.some((each) => each.depth > 1)) return Infinity;
  if (line.length === 1) return Math.hypot(x - first.x, y - first.y);
  let nearest = Infinity;
  for (let n = 1; n < line.length; n++) {
    const [a, b] = [line[n - 1], line[n]] as [OnScreen, OnScreen];
    const behind = line.length > 2 && a.depth > centre.depth ? 8 : 0;
    nearest = Math.min(nearest, toSegment(x, y, a, b) + behind);
  }
  return nearest;
}
