/** The straight path of the tool before a motion: solid if it is free, otherwise dashed. */

import {
  type BufferGeometry,
  CylinderGeometry,
  Mesh,
  MeshBasicMaterial,
  type Scene,
  SphereGeometry,
  Vector3,
} from "three";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import type { Position } from "../protocol/types";
import type { Palette } from "./palette";

/** `unknown`: not checked, or the motion is not straight. */
export type PathState = "free" | "blocked" | "unknown";

export interface StraightPath {
  from: Position;
  to: Position;
  state: PathState;
}

/** Half thickness, shortest drawn length, lengths of a dash and of a gap, m. */
const RADIUS = 0.003;
const SHORTEST = 0.005;
const DASHES: Record<PathState, readonly [number, number] | null> = {
  free: null,
  unknown: [0.02, 0.012],
  blocked: [0.008, 0.012],
};
const MAX_DASHES = 60;
const up = new Vector3(0, 1, 0);

export class PathLine {
  shown: StraightPath | null = null;
  private wanted: StraightPath | null = null;
  private readonly material = new MeshBasicMaterial({ transparent: true, opacity: 0.85 });
  private readonly mesh = new Mesh<BufferGeometry, MeshBasicMaterial>(undefined, this.material);

  constructor(scene: Scene) {
    this.mesh.userData.ground = true; // not pickable
    this.mesh.visible = false;
    scene.add(this.mesh);
  }

  /** Return whether it looks different now. */
  show(path: StraightPath | null, palette: Palette): boolean {
    if (same(path, this.wanted)) return false;
    this.wanted = path;
    const from = path && new Vector3(path.from.x, path.from.y, path.from.z);
    const to = path && new Vector3(path.to.x, path.to.y, path.to.z);
    const length = from && to ? from.distanceTo(to) : 0;
    this.shown = length > SHORTEST ? path : null;
    this.mesh.visible = this.shown !== null;
    if (!this.shown || !from || !to) return true;
    const { state } = this.shown;
    this.material.color.copy(
      state === "free" ? palette.reach.reachable : state === "blocked" ? palette.fault : palette.locked,
    );
    this.mesh.geometry.dispose();
    this.mesh.geometry = pieces(length, DASHES[state]);
    this.mesh.position.copy(from);
    this.mesh.quaternion.setFromUnitVectors(up, to.sub(from).normalize());
    return true;
  }

  dispose(): void {
    this.mesh.removeFromParent();
    this.mesh.geometry.dispose();
    this.material.dispose();
  }
}

/** Tolerance, m: the pose reported by a robot at standstill varies a little. */
const POSE_TOLERANCE = 2e-4;

function same(a: StraightPath | null, b: StraightPath | null): boolean {
  if (!a || !b) return a === b;
  const apart = (p: Position, q: Position) => Math.hypot(p.x - q.x, p.y - q.y, p.z - q.z);
  return a.state === b.state && apart(a.from, b.from) < POSE_TOLERANCE && apart(a.to, b.to) < POSE_TOLERANCE;
}

/** Return a line or its dashes along y, from the origin, with a sphere at the end. */
function pieces(length: number, dash: readonly [number, number] | null): BufferGeometry {
  const found: BufferGeometry[] = [new SphereGeometry(RADIUS * 3, 12, 8).translate(0, length, 0)];
  const [on, off] = dash ?? [length, 0];
  const step = Math.max(on + off, length / MAX_DASHES); // long paths have longer dashes, not more of them
  for (let at = 0; at < length - 1e-6; at += step) {
    const piece = Math.min((step * on) / (on + off), length - at);
    found.push(new CylinderGeometry(RADIUS, RADIUS, piece, 6, 1, true).translate(0, at + piece / 2, 0));
  }
  const whole = mergeGeometries(found);
  for (const each of found) each.dispose();
  return whole;
}
