/** The user's choices for moving robots: frame, step size, speed. Stored while the page is open. */

import { getState, setUi, useEditor } from "../../store/store";
import type { Jogging, MotionOptions } from "../../store/ui";

const RAD = Math.PI / 180;

export const DISTANCES = [0.0001, 0.001, 0.01, 0.05, 0.1] as const;
export const ANGLES = [0.1 * RAD, RAD, 5 * RAD, 10 * RAD, 45 * RAD] as const;

/** Velocities at full speed, m/s and rad/s; hold-to-run motions are slow. */
export const FASTEST = { linear: 0.25, angular: 0.8, joint: 0.6 } as const;

export const useMotionOptions = (): Jogging => useEditor((state) => state.ui.jogging);
export const setMotionOptions = (change: Partial<Jogging>): void =>
  setUi({ jogging: { ...getState().ui.jogging, ...change } });
export const motionOptions = (): MotionOptions => {
  const { speed, safe, linear } = getState().ui.jogging;
  return { speed, safe, linear };
};
