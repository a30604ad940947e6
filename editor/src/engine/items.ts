/** What the 3D view is told to show: plain data. An item that is the same object as before is not looked at again. */

import type { Orientation, Pose, Position } from "../protocol/types";

export type Shape =
  | { kind: "box"; size: [number, number, number] }
  | { kind: "cylinder"; radius: number; height: number }
  | { kind: "sphere"; radius: number }
  | { kind: "mesh"; asset: string }
  /** No model: a marker where it stands. */
  | { kind: "none" };

interface Base {
  id: string;
  name: string;
  /** In whose frame `pose` or `position` is; the world's when absent. */
  parent?: string;
  selected: boolean;
  /** Somebody else holds it: his name. */
  lockedBy: string;
  /** How much is seen through it: 0 opaque, 1 not there. */
  faint: number;
}

export interface ObjectItem extends Base {
  kind: "object";
  pose: Pose;
  shape: Shape;
  trouble: boolean;
}

export interface RobotItem extends Base {
  kind: "robot";
  pose: Pose;
  /** Asset of its URDF package; empty where it has none. */
  urdf: string;
  /** The axes of its end effectors are drawn. */
  axes: boolean;
  /** Joints are expected; where none come it is marked as stale. */
  online: boolean;
  trouble: boolean;
  /** Where it would be, beside where it is. */
  ghost?: { joints: Record<string, number>; possible: boolean; at?: Pose | undefined } | undefined;
}

export interface PointItem extends Base {
  kind: "point";
  /** A line leads to what it hangs on. */
  tied: boolean;
  /** How large the user wants points, of what they are. */
  size: number;
  position: Position;
  breakpoint: boolean;
}

/** Empty: nothing is known, or nothing is to be reached. */
export type ReachShown = "" | "reachable" | "near_limit" | "in_collision" | "out_of_reach" | "unknown";

export interface OrientationItem extends Base {
  kind: "orientation";
  parent: string;
  orientation: Orientation;
  reach: ReachShown;
}

export interface PuckItem extends Base {
  kind: "action";
  /** Its point; START and END have a position in the world instead. */
  parent?: string;
  position?: Position;
  /** Which it is of the pucks above its point, from 0. */
  level: number;
  /** How many there are. */
  count: number;
  role: "action" | "start" | "end";
  running: boolean;
  breakpoint: boolean;
  /** Of its object, so that all of one object have one colour. */
  colour: number;
  /** Whether its robot gets where it is told to go. */
  reach: ReachShown;
}

export interface LinkItem extends Base {
  kind: "logic";
  from: string;
  to: string;
  /** Empty for what is taken in any case; else what stands at the line. */
  condition: string;
  branch: "always" | "true" | "false" | "value";
}

export type Item = ObjectItem | RobotItem | PointItem | OrientationItem | PuckItem | LinkItem;
