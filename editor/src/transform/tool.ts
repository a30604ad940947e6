/**
 * Settings of the transform tool: units, steps, frame, snapping. They are stored on the server for all devices of the
 * user.
 */

import { memoized } from "../store/memo";
import type { State } from "../store/state";
import { ANGLE_UNITS, type AngleUnit, LENGTH_UNITS, type LengthUnit } from "./amounts";
import type { FrameName } from "./placing";

/** `grid`: multiples of the step; `surface`: the surface under the pointer; `point`: the position of another item. */
export type Snap = "none" | "grid" | "surface" | "point";

export interface ToolSettings {
  length: LengthUnit;
  angle: AngleUnit;
  /** Steps, m and rad. */
  lengthStep: number;
  angleStep: number;
  frame: FrameName;
  snap: Snap;
  /** Whether typed numbers are relative. */
  by: boolean;
}

/** Key in the general view state of the user. */
export const TOOL = "transform";

const DEFAULTS: ToolSettings = {
  length: "mm",
  angle: "°",
  lengthStep: 0.01,
  angleStep: Math.PI / 18,
  frame: "world",
  snap: "none",
  by: false,
};

const FRAMES: readonly FrameName[] = ["world", "parent", "robot", "own", "view"];
const SNAPS: readonly Snap[] = ["none", "grid", "surface", "point"];
const settingsMemo = memoized((stored: unknown): ToolSettings => ({ ...DEFAULTS, ...understood(stored) }));

/** Return the settings; the same object while they do not change. Unknown values of another version are ignored. */
export function toolSettings(state: State): ToolSettings {
  return settingsMemo(state.view.general[TOOL]);
}

function understood(stored: unknown): Partial<ToolSettings> {
  const given = (stored ?? {}) as Partial<Record<keyof ToolSettings, unknown>>;
  const found: Partial<ToolSettings> = {};
  const step = (value: unknown): value is number => typeof value === "number" && value > 0 && value < 100;
  if (LENGTH_UNITS.includes(given.length as LengthUnit)) found.length = given.length as LengthUnit;
  if (ANGLE_UNITS.includes(given.angle as AngleUnit)) found.angle = given.angle as AngleUnit;
  if (step(given.lengthStep)) found.lengthStep = given.lengthStep;
  if (step(given.angleStep)) found.angleStep = given.angleStep;
  if (FRAMES.includes(given.frame as FrameName)) found.frame = given.frame as FrameName;
  if (SNAPS.includes(given.snap as Snap)) found.snap = given.snap as Snap;
  if (typeof given.by === "boolean") found.by = given.by;
  return found;
}
