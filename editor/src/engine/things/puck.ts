/**
 * An action: a disc above its point; several of a point are stacked. START and END have their own positions. Pucks keep
 * a minimum size on the screen, so that fingers can hit them.
 */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import {
  type BufferGeometry,
  Color,
  CylinderGeometry,
  Matrix4,
  MeshLambertMaterial,
  Object3D,
  OctahedronGeometry,
  SphereGeometry,
  TorusGeometry,
  Vector3,
} from "three";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import type { Instance } from "../baked";
import type { Batch } from "../batches";
import type { PuckItem, ReachShown } from "../items";
import { type Context, Thing } from "../thing";

/** Radius of a puck, of START and END, height of the first one above its point, and distance between pucks, m. */
const RADIUS = 0.018;
const TERMINAL = 0.03;
/** Radius of the lower edge of a call, whose puck is a square, m. */
const CALL = 0.026;
const FIRST = 0.035;
const NEXT = 0.006;
/** Thickness of a puck, and distance of the pucks in a stack, m. */
const THICK = 0.007;
const STACKED = 0.0085;
/** Smallest radius on the screen, pixels. */
const LEAST = 9;
/** Largest magnification; in steps, since the lines between pucks are redrawn with each. */
const MOST = 4;
/** Part of the background in the colour of pale pucks. */
const PALE = 0.65;
const up = new Vector3();

/** Height of the reachability symbol above the middle of the puck, m. */
const SIGN = 0.012;
const bar = () => new CylinderGeometry(0.0028, 0.0028, 0.034, 6).rotateZ(Math.PI / 2);
function cross(): BufferGeometry {
  const bars = [bar().rotateZ(Math.PI / 4), bar().rotateZ(-Math.PI / 4)];
  const whole = mergeGeometries(bars);
  for (const each of bars) each.dispose();
  return whole;
}
/** Reachable: a dot; near a limit: a ring; in collision: a lump; out of reach: a cross. Readable without colours. */
const SIGNS: Partial<Record<ReachShown, () => BufferGeometry>> = {
  reachable: () => new SphereGeometry(0.0055, 12, 8),
  near_limit: () => new TorusGeometry(0.011, 0.0026, 8, 24),
  in_collision: () => new OctahedronGeometry(0.012),
  out_of_reach: cross,
};

const REASONS: Partial<Record<ReachShown, MessageDescriptor>> = {
  near_limit: msg`near a limit`,
  in_collision: msg`in collision`,
  out_of_reach: msg`out of reach`,
};

export class PuckThing extends Thing<PuckItem> {
  readonly root = new Object3D();
  item: PuckItem;
  private readonly batch: Batch;
  private readonly instance: Instance;
  private grown = 1;
  private readonly pale = new Color();
  private signs: Batch | null = null;
  private readonly signInstance: Instance;

  constructor(item: PuckItem, context: Context) {
    super(context);
    this.item = item;
    const { role } = item;
    const edge = role === "action" || role === "call";
    this.batch = context.batches.of(
      edge ? role : "start and end",
      () => [
        (role === "action"
          ? new CylinderGeometry(RADIUS, RADIUS, THICK, context.quality === "low" ? 12 : 24)
          : role === "call"
            ? new CylinderGeometry(RADIUS, CALL, THICK, 4).rotateY(Math.PI / 4)
            : new CylinderGeometry(TERMINAL, TERMINAL, 0.014, 6)
        ).rotateX(Math.PI / 2),
        new MeshLambertMaterial(),
      ],
      edge ? RADIUS : 0,
      edge ? THICK / 2 / RADIUS : 0,
    );
    this.instance = { id: item.id, frame: this.root, offset: new Matrix4(), color: context.palette.point };
    this.batch.add(this.instance);
    this.signInstance = { id: item.id, frame: this.root, offset: new Matrix4(), color: context.palette.point };
  }

  update(item: PuckItem): void {
    this.item = item;
    if (item.position) {
      this.root.position.set(item.position.x, item.position.y, item.position.z);
      this.root.matrixAutoUpdate = this.root.matrixWorldAutoUpdate = true;
    }
    const { palette } = this.context;
    this.instance.color = item.selected
      ? palette.selected
      : item.running
        ? palette.running
        : item.role === "start"
          ? palette.start
          : item.role === "end"
            ? palette.end
            : item.breakpoint
              ? palette.breakpoint
              : item.lockedBy
                ? palette.locked
                : (palette.actions[item.colour % palette.actions.length] ?? palette.point);
    if (item.dim && !item.running)
      this.instance.color = this.pale.lerpColors(this.instance.color, palette.background, PALE);
    this.showReach();
    this.scale();
  }

  /** The symbol on it. */
  private showReach(): void {
    const { reach } = this.item;
    const make = SIGNS[reach];
    const signs =
      make && (this.item.open || this.item.count === 1)
        ? this.context.batches.of(`puck ${reach}`, () => [make(), new MeshLambertMaterial()])
        : null;
    if (reach) this.signInstance.color = this.context.palette.reach[reach];
    if (signs === this.signs) return;
    this.signs?.remove(this.signInstance);
    signs?.add(this.signInstance);
    this.signs = signs;
  }

  private scale(): void {
    const { faint, selected, running } = this.item;
    const size = faint >= 1 ? 0 : this.grown * (selected || running ? 1.25 : 1);
    this.instance.offset.makeScale(size, size, size);
    this.signInstance.offset.makeScale(size, size, size).setPosition(0, 0, SIGN * size);
  }

  override resized(): boolean {
    const { role } = this.item;
    const terminal = role === "start" || role === "end";
    const wanted = (LEAST * this.context.metresPerPixel(this.anchor(up))) / (terminal ? TERMINAL : RADIUS);
    const grown = Math.min(MOST, Math.max(1, 2 ** (Math.ceil(Math.log2(wanted) * 2) / 2)));
    if (grown === this.grown) return false;
    this.grown = grown;
    this.scale();
    return true;
  }

  /** Above the point along the world's z axis, independent of the parent's rotation. */
  override placed(): void {
    if (this.item.position || !this.root.parent) return;
    const { level, count } = this.item;
    if (!this.item.open) {
      this.root.parent.getWorldPosition(up).z += (FIRST + (count - 1 - level) * STACKED) * this.grown;
      return this.put();
    }
    const around = count > 1 ? (1.15 * RADIUS * this.grown) / Math.sin(Math.PI / count) : 0;
    const angle = (2 * Math.PI * level) / count;
    this.root.parent.getWorldPosition(up).z += (FIRST + level * NEXT) * this.grown;
    up.x += around * Math.cos(angle);
    up.y += around * Math.sin(angle);
    this.put();
  }

  private put(): void {
    this.root.matrixAutoUpdate = false;
    this.root.matrixWorldAutoUpdate = false;
    this.root.matrixWorld.makeTranslation(up);
  }

  override anchor(target: Vector3): Vector3 {
    return target.setFromMatrixPosition(this.root.matrixWorld);
  }

  override get sign(): string {
    return this.signs ? this.item.reach : "";
  }

  override badge(): string {
    if (this.item.lockedBy) return t`in use by ${this.item.lockedBy}`;
    const reason = REASONS[this.item.reach];
    return reason && this.item.selected ? i18n._(reason) : "";
  }

  override dispose(): void {
    this.batch.remove(this.instance);
    this.signs?.remove(this.signInstance);
    this.root.removeFromParent();
  }
}
