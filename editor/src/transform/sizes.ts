/** Sizes of shapes after dragging a face or typing a number. Pure functions; all in m. */

import { t } from "@lingui/core/macro";
import type { ObjectModel, Pose, Position } from "../protocol/types";
import { inverted, rotated } from "../viewmodel/frames";
import { type Axis, dot, plusOf } from "./placing";

/** Smallest size. */
export const THINNEST = 0.001;
const WIDEST = 50;

const within = (value: number) => Math.min(WIDEST, Math.max(THINNEST, value));

/** Return half extents along the own axes. */
export function halfOf({ box, cylinder, sphere }: ObjectModel): Record<Axis, number> {
  if (box) return { x: box.size_x / 2, y: box.size_y / 2, z: box.size_z / 2 };
  if (cylinder) return { x: cylinder.radius, y: cylinder.radius, z: cylinder.height / 2 };
  const radius = sphere?.radius ?? 0;
  return { x: radius, y: radius, z: radius };
}

/**
 * Drag a face outwards by a distance. The opposite face stays, so the centre moves by half of it (`shift`, m); round
 * shapes grow about their axis.
 */
export function pulled(model: ObjectModel, axis: Axis, by: number): { model: ObjectModel; shift: number } {
  const { box, cylinder, sphere } = model;
  if (box) {
    const side = `size_${axis}` as const;
    const size = within(box[side] + by);
    return { model: { ...model, box: { ...box, [side]: size } }, shift: (size - box[side]) / 2 };
  }
  if (cylinder && axis === "z") {
    const height = within(cylinder.height + by);
    return { model: { ...model, cylinder: { ...cylinder, height } }, shift: (height - cylinder.height) / 2 };
  }
  if (cylinder)
    return { model: { ...model, cylinder: { ...cylinder, radius: within(cylinder.radius + by) } }, shift: 0 };
  if (sphere) return { model: { ...model, sphere: { ...sphere, radius: within(sphere.radius + by) } }, shift: 0 };
  return { model, shift: 0 };
}

/** A size that can be typed. */
export interface Measure {
  label: string;
  value: number;
  put: (value: number) => ObjectModel;
}

export function measures(model: ObjectModel): Measure[] {
  const { box, cylinder, sphere } = model;
  if (box) {
    return (["x", "y", "z"] as const).map((axis) => {
      const side = `size_${axis}` as const;
      return {
        label: axis.toUpperCase(),
        value: box[side],
        put: (value) => ({ ...model, box: { ...box, [side]: within(value) } }),
      };
    });
  }
  if (cylinder) {
    return [
      {
        label: t`Radius`,
        value: cylinder.radius,
        put: (value) => ({ ...model, cylinder: { ...cylinder, radius: within(value) } }),
      },
      {
        label: t`Height`,
        value: cylinder.height,
        put: (value) => ({ ...model, cylinder: { ...cylinder, height: within(value) } }),
      },
    ];
  }
  if (!sphere) return [];
  return [
    {
      label: t`Radius`,
      value: sphere.radius,
      put: (value) => ({ ...model, sphere: { ...sphere, radius: within(value) } }),
    },
  ];
}

/** Return the position of the centre of a shape that is placed at a point of a surface with this normal. */
export function lifted(
  point: Position,
  normal: Position,
  { pose, model }: { pose: Pose; model?: ObjectModel },
): Position {
  if (!model) return { x: point.x, y: point.y, z: point.z };
  const { x, y, z } = rotated(normal, inverted(pose.orientation));
  const half = halfOf(model);
  const { box, cylinder, sphere } = model;
  const reach = box
    ? dot({ x: Math.abs(x), y: Math.abs(y), z: Math.abs(z) }, half)
    : cylinder
      ? Math.abs(z) * half.z + Math.hypot(x, y) * half.x
      : (sphere?.radius ?? 0);
  return plusOf(point, normal, reach);
}
