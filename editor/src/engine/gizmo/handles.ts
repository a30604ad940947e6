/** What there is to take hold of, and which of it is under a pointer: judged in pixels, so that it suits fingers. */

import { type Camera, Vector3 } from "three";
import { toSegment } from "./drags";

export type Axis = "x" | "y" | "z";
export const AXES: readonly Axis[] = ["x", "y", "z"];

export type Handle =
  /** Move along an axis, in the plane square to an axis, or anywhere. */
  | { do: "axis"; axis: Axis }
  | { do: "plane"; axis: Axis }
  | { do: "free" }
  /** Turn about an axis. */
  | { do: "ring"; axis: Axis }
  /** Pull a face: the one in the direction of an axis, or against it. */
  | { do: "face"; axis: Axis; sign: 1 | -1 };

export type GizmoMode = "move" | "turn" | "size";

export const keyOf = (handle: Handle): string =>
  handle.do === "free"
    ? "free"
    : handle.do === "face"
      ? `face ${handle.sign > 0 ? "+" : "-"}${handle.axis}`
      : `${handle.do} ${handle.axis}`;

/** In lengths of the gizmo: where a shaft begins and ends, where a plane's square is, how large a ring is. */
export const SHAFT = [0.3, 1.05] as const;
export const SQUARE = [0.34, 0.56] as const;
export const RING = 0.85;

export const UNIT: Record<Axis, Vector3> = {
  x: new Vector3(1, 0, 0),
  y: new Vector3(0, 1, 0),
  z: new Vector3(0, 0, 1),
};

export function handlesOf(mode: GizmoMode, allowed: readonly Axis[]): Handle[] {
  if (mode === "turn") return allowed.map((axis) => ({ do: "ring", axis }));
  if (mode === "size") {
    return allowed.flatMap((axis) => ([1, -1] as const).map((sign): Handle => ({ do: "face", axis, sign })));
  }
  return [
    { do: "free" },
    ...allowed.map((axis): Handle => ({ do: "axis", axis })),
    ...allowed.map((axis): Handle => ({ do: "plane", axis })),
  ];
}

/** Two axes square to one, in the order that turns from the first to the second about it. */
export function square(axis: Axis): [Vector3, Vector3] {
  const at = AXES.indexOf(axis);
  return [UNIT[AXES[(at + 1) % 3] ?? "x"], UNIT[AXES[(at + 2) % 3] ?? "x"]];
}

/** The line by which a handle is hit, in lengths of the gizmo in its own frame; a single point for small ones. */
export function outline(handle: Handle, half: Record<Axis, number>): Vector3[] {
  switch (handle.do) {
    case "free":
      return [new Vector3()];
    case "axis":
      return SHAFT.map((at) => UNIT[handle.axis].clone().multiplyScalar(at));
    case "plane": {
      const [a, b] = square(handle.axis);
      const middle = (SQUARE[0] + SQUARE[1]) / 2;
      return [a.clone().multiplyScalar(middle).addScaledVector(b, middle)];
    }
    case "face":
      return [UNIT[handle.axis].clone().multiplyScalar(handle.sign * half[handle.axis])];
    case "ring": {
      const [a, b] = square(handle.axis);
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

export interface OnScreen {
  x: number;
  y: number;
  /** Of normalised device coordinates: larger is farther. */
  depth: number;
}

export function onScreen(point: Vector3, camera: Camera, width: number, height: number): OnScreen {
  const at = point.clone().project(camera);
  return { x: ((at.x + 1) / 2) * width, y: ((1 - at.y) / 2) * height, depth: at.z };
}

/** px from a pointer to a handle whose outline is on the screen; of what turns away from the viewer a bit more. */
export function apart(x: number, y: number, line: OnScreen[], centre: OnScreen): number {
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
