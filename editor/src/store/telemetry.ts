/**
 * What robots report many times a second: joints and end effectors. It goes past the store, straight to the 3D view
 * and to the read-outs that want it, and is drawn a little late so that it can be interpolated.
 */

import type { EefPose, RobotEefData, RobotJointsData } from "../protocol/types";

export interface Sample {
  /** Seconds, of `performance.now()`, when it came. */
  at: number;
  /** Seconds, of the cell's clock, when it was read; as `at` where the server does not say it. */
  read: number;
  joints: Map<string, number>;
}

/** Seconds after which what is shown is stale. */
export const STALE = 0.5;

/** rad or m: what moves less is not drawn anew. */
export const STILL = 1e-4;

type Listener = (robotId: string) => void;

export class Telemetry {
  private readonly joints = new Map<string, [Sample | null, Sample]>();
  private readonly eefs = new Map<string, { at: number; poses: EefPose[] }>();
  private readonly listeners = new Set<Listener>();

  constructor(private readonly clock: () => number = () => performance.now() / 1000) {}

  takeJoints(data: RobotJointsData): void {
    const at = this.clock();
    const read = data.time_ms === undefined ? at : data.time_ms / 1000;
    const sample = { at, read, joints: new Map(data.joints.map((one) => [one.name, one.value])) };
    this.joints.set(data.robot_id, [this.joints.get(data.robot_id)?.[1] ?? null, sample]);
    this.tell(data.robot_id);
  }

  takeEef(data: RobotEefData): void {
    this.eefs.set(data.robot_id, { at: this.clock(), poses: data.end_effectors });
    this.tell(data.robot_id);
  }

  /** Joints as last reported; undefined when nothing is known. */
  latest(robotId: string): Sample | undefined {
    return this.joints.get(robotId)?.[1];
  }

  endEffectors(robotId: string): EefPose[] {
    return this.eefs.get(robotId)?.poses ?? [];
  }

  /** Seconds since the robot last reported; Infinity when it never did. */
  age(robotId: string): number {
    const at = Math.max(this.latest(robotId)?.at ?? -Infinity, this.eefs.get(robotId)?.at ?? -Infinity);
    return this.clock() - at;
  }

  /**
   * Joints to be drawn now: between the last two samples, one sample's time after them. `settled` when the last one
   * is reached, so that there is nothing more to draw until another comes. Where samples come about as often as is
   * drawn, every `period` s, there is nothing between them to be seen: the last one is drawn at once.
   */
  interpolated(robotId: string, period = 0): { joints: Map<string, number>; settled: boolean } | undefined {
    const pair = this.joints.get(robotId);
    if (!pair) return undefined;
    const [before, last] = pair;
    // After a pause there is nothing to interpolate from; between samples a tenth of a second at most.
    // By when they were read, not by when they came: the network bunches them.
    const span = before ? last.read - before.read : 0;
    if (!before || span <= period * 1.5 || span <= 0 || span > 0.25 || alike(before, last))
      return { joints: last.joints, settled: true };
    const part = (this.clock() - last.at) / span;
    if (part >= 1) return { joints: last.joints, settled: true };
    const between = new Map<string, number>();
    for (const [name, value] of last.joints) {
      const from = before.joints.get(name) ?? value;
      between.set(name, from + (value - from) * Math.max(0, part));
    }
    return { joints: between, settled: false };
  }

  /** Be called with each report, by the robot's id; gives what ends that. */
  subscribe(listener: Listener): () => void {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  /** Forget all: the scene went offline. */
  clear(): void {
    const known = new Set([...this.joints.keys(), ...this.eefs.keys()]);
    this.joints.clear();
    this.eefs.clear();
    for (const id of known) this.tell(id);
  }

  private tell(robotId: string): void {
    for (const listener of this.listeners) listener(robotId);
  }
}

/** An arm at rest goes on reporting: there is no way from one sample to the next. */
function alike(one: Sample, other: Sample): boolean {
  for (const [name, value] of other.joints) if (Math.abs((one.joints.get(name) ?? value) - value) > STILL) return false;
  return true;
}

export const telemetry = new Telemetry();
