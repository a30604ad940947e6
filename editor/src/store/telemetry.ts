/**
 * Telemetry of robots: joints and end effectors, many times a second. It bypasses the store, and is drawn with a small
 * delay for interpolation.
 */

import type { EefPose, RobotEefData, RobotJointsData } from "../protocol/types";

interface Sample {
  /** Time of arrival, s, as `performance.now()`. */
  at: number;
  /** Time of measurement by the clock of the server, s; like `at` if unknown. */
  read: number;
  joints: Map<string, number>;
}

/** Age after which data is outdated, s. */
export const STALE = 0.5;

/** Smallest change that is drawn, rad or m. */
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
    this.notify(data.robot_id);
  }

  takeEef(data: RobotEefData): void {
    this.eefs.set(data.robot_id, { at: this.clock(), poses: data.end_effectors });
    this.notify(data.robot_id);
  }

  /** Return the last reported joints; undefined if unknown. */
  latest(robotId: string): Sample | undefined {
    return this.joints.get(robotId)?.[1];
  }

  endEffectors(robotId: string): EefPose[] {
    return this.eefs.get(robotId)?.poses ?? [];
  }

  /** Return the time since the last report, s; Infinity without one. */
  age(robotId: string): number {
    const at = Math.max(this.latest(robotId)?.at ?? -Infinity, this.eefs.get(robotId)?.at ?? -Infinity);
    return this.clock() - at;
  }

  /**
   * Return the joints to draw now, interpolated between the last two samples with a delay of one sample period.
   * `settled` is true at the last sample, when no further frame is needed. If samples arrive about as often as frames
   * are drawn, every `period` s, the last one is drawn at once.
   */
  interpolated(robotId: string, period = 0): { joints: Map<string, number>; settled: boolean } | undefined {
    const pair = this.joints.get(robotId);
    if (!pair) return undefined;
    const [before, last] = pair;
    // Without interpolation after a pause; otherwise over at most 0.1 s. Times of measurement are used, since the
    // network delivers samples in bursts.
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

  /** Call a function with the robot's id on each report; return a function that unsubscribes it. */
  subscribe(listener: Listener): () => void {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  /** Discard all telemetry, since the scene went offline. */
  clear(): void {
    const known = new Set([...this.joints.keys(), ...this.eefs.keys()]);
    this.joints.clear();
    this.eefs.clear();
    for (const id of known) this.notify(id);
  }

  private notify(robotId: string): void {
    for (const listener of this.listeners) listener(robotId);
  }
}

/** A robot at standstill keeps reporting; equal samples need no interpolation. */
function alike(one: Sample, other: Sample): boolean {
  for (const [name, value] of other.joints) if (Math.abs((one.joints.get(name) ?? value) - value) > STILL) return false;
  return true;
}

export const telemetry = new Telemetry();
