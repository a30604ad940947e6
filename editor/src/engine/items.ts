/** Items of the 3D view, as plain data. An item that is the same object as before is not updated. */

import type { Orientation, Pose, Position } from "../protocol/types";

export type Shape =
  | { kind: "box"; size: [number, number, number] }
  | { kind: "cylinder"; radius: number; height: number }
  | { kind: "sphere"; radius: number }
  | { kind: "mesh"; asset: string }
  /** Without a collision model: a device by the icon of its type, otherwise a marker. */
  | { kind: "none"; icon?: string };

interface Base {
  id: string;
  name: string;
  /** Id of the item in whose frame `pose` or `position` is; by default the world. */
  parent?: string;
  selected: boolean;
  /** Name of another user who has locked it. */
  lockedBy: string;
  /** Transparency from 0, opaque, to 1, invisible. */
  faint: number;
  /** Drawn pale, because another part of the program is selected. */
  dim?: boolean;
}

export interface ObjectItem extends Base {
  kind: "object";
  pose: Pose;
  shape: Shape;
  fault: boolean;
  /** Visible state that the device reports, such as an open door, by name; undefined while it is unknown. */
  values?: Readonly<Record<string, number>> | undefined;
  /** Places on it at which sensors detect parts, in its frame. */
  parts?: readonly DetectedPart[] | undefined;
}

/** A part at a sensor; `seen` while the sensor detects one. */
export interface DetectedPart {
  sensor: string;
  seen: boolean;
  position: Position;
  size: Position;
}

/** A part that a robot carries, in the frame of an end effector. */
export interface CarriedItem {
  link: string;
  pose: Pose;
  shape: Shape;
}

export interface RobotItem extends Base {
  kind: "robot";
  pose: Pose;
  /** Asset of its URDF package; empty if it has none. */
  urdf: string;
  /** Whether the axes of its end effectors are drawn. */
  axes: boolean;
  /** Whether reports of joints are expected; without them, the robot is marked as outdated. */
  online: boolean;
  fault: boolean;
  /** Icon and values of the gripper at its flange; undefined without one. */
  tool?: { icon: string; values: Readonly<Record<string, number>> } | undefined;
  parts?: readonly CarriedItem[] | undefined;
  /** Pose of the ghost, shown in addition to the robot. */
  ghost?: { joints: Record<string, number>; possible: boolean; at?: Pose | undefined } | undefined;
}

export interface PointItem extends Base {
  kind: "point";
  /** Whether a line to its parent is drawn. */
  tied: boolean;
  /** Size of points chosen by the user, relative. */
  size: number;
  position: Position;
  breakpoint: boolean;
}

/** Reachability of a point; empty if it is unknown or not needed. */
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
  /** Number among the pucks above its point, from 0. */
  level: number;
  /** Number of these pucks. */
  count: number;
  /** Whether the pucks are arranged around the point; otherwise they are a stack, whose top one shows their number. */
  open: boolean;
  role: "action" | "call" | "start" | "end";
  running: boolean;
  breakpoint: boolean;
  /** Color index of its object, so that all actions of an object look the same. */
  colour: number;
  /** Reachability of its targets. */
  reach: ReachShown;
}

export interface LinkItem extends Base {
  kind: "logic";
  from: string;
  to: string;
  /** Whether both ends are in one closed stack, so that it is not drawn. */
  inside: boolean;
  /** Text at the line; empty for an unconditional connection. */
  condition: string;
  branch: "always" | "true" | "false" | "value" | "error";
  /** Whether the running program has followed it; it is then drawn in the colour of running actions. */
  taken?: boolean;
}

export type Item = ObjectItem | RobotItem | PointItem | OrientationItem | PuckItem | LinkItem;
