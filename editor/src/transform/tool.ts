/** How the transform tool is set: units, steps, whose axes, what it snaps to. The user finds it again on every tablet. */

import { memoized } from "../store/memo";
import type { State } from "../store/state";
import { ANGLE_UNITS, type AngleUnit, LENGTH_UNITS, type LengthUnit } from "./amounts";
import type { FrameName } from "./placing";

/** `grid`: the steps' raster; `surface`: on what is below the pointer; `point`: where another thing stands. */
export type Snap = "none" | "grid" | "surface" | "point";

export interface ToolSettings {
  length: LengthUnit;
  angle: AngleUnit;
  /** m and rad. */
  lengthStep: number;
  angleStep: number;
  frame: FrameName;
  snap: Snap;
  /** Numbers that are typed are changes. */
  by: boolean;
}

/** Key of the user's general view state. */
export const TOOL = "transform";

export const DEFAULTS: ToolSettings = {
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

function understood(kept: unknown): Partial<ToolSettings> {
  const given = (kept ?? {}) as Partial<Record<keyof ToolSettings, unknown>>;
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
