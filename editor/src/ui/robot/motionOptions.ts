/** How the user moves robots: frame, step size, speed. Stored while the page is open. */

import { useStore } from "zustand";
import { createStore } from "zustand/vanilla";
import type { MotionOptions } from "../../commands/robot";

/** `selected`: the frame of the selected item. */
export type FrameName = "world" | "robot" | "tool" | "selected";

export interface Jogging extends MotionOptions {
  frame: FrameName;
  /** Step per press, or hold to move. */
  way: "step" | "hold";
  what: "position" | "orientation";
  /** Step sizes, m and rad. */
  distance: number;
  angle: number;
}

const RAD = Math.PI / 180;

export const DISTANCES = [0.0001, 0.001, 0.01, 0.05, 0.1] as const;
export const ANGLES = [0.1 * RAD, RAD, 5 * RAD, 10 * RAD, 45 * RAD] as const;

/** Velocities at full speed, m/s and rad/s; held motions are slow. */
export const FASTEST = { linear: 0.25, angular: 0.8, joint: 0.6 } as const;

export const manner = createStore<Jogging>(() => ({
  frame: "world",
  way: "step",
  what: "position",
  distance: 0.01,
  angle: 5 * RAD,
  speed: 0.25,
  safe: true,
  linear: true,
}));

export const useMotionOptions = (): Jogging => useStore(manner);
export const setMotionOptions = (change: Partial<Jogging>): void => manner.setState(change);
export const motionOptions = (): MotionOptions => {
  const { speed, safe, linear } = manner.getState();
  return { speed, safe, linear };
};
