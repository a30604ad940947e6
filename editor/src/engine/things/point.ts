/** An action point: a sphere, drawn together with all others. It keeps a minimum size on the screen. */

import { t } from "@lingui/core/macro";
import { Matrix4, MeshLambertMaterial, Object3D, SphereGeometry, Vector3 } from "three";
import type { Instance } from "../baked";
import type { Batch } from "../batches";
import type { PointItem } from "../items";
import { setPosition } from "../poses";
import { type Context, Thing } from "../thing";

const RADIUS = 0.012;
/** Smallest radius on the screen, pixels; steps and limit of the magnification. */
const LEAST = 5;
const MOST = 8;
const at = new Vector3();

export class PointThing extends Thing<PointItem> {
  readonly root = new Object3D();
  item: PointItem;
  private readonly batch: Batch;
  private readonly instance: Instance;
  private grown = 1;

  constructor(item: PointItem, context: Context) {
    super(context);
    this.item = item;
    this.batch = context.batches.of(
      "point",
      () => [new SphereGeometry(RADIUS, 14, 10), new MeshLambertMaterial()],
      RADIUS,
    );
    this.instance = { id: item.id, frame: this.root, offset: new Matrix4(), color: context.palette.point };
    this.batch.add(this.instance);
  }

  update(item: PointItem): void {
    this.item = item;
    setPosition(this.root, item.position);
    const { palette } = this.context;
    this.instance.color = item.selected
      ? palette.selected
      : item.breakpoint
        ? palette.breakpoint
        : item.lockedBy
          ? palette.locked
          : palette.point;
    this.scale();
  }

  private scale(): void {
    const { faint, size, selected } = this.item;
    const scale = faint >= 1 ? 0 : this.grown * size * (selected ? 1.4 : 1);
    this.instance.offset.makeScale(scale, scale, scale);
  }

  override resized(): boolean {
    const wanted = (LEAST * this.context.metresPerPixel(this.anchor(at))) / RADIUS;
    const grown = Math.min(MOST, Math.max(1, 2 ** (Math.ceil(Math.log2(wanted) * 2) / 2)));
    if (grown === this.grown) return false;
    this.grown = grown;
    this.scale();
    return true;
  }

  override anchor(target: Vector3): Vector3 {
    return this.root.getWorldPosition(target);
  }

  override badge(): string {
    return this.item.lockedBy ? t`in use by ${this.item.lockedBy}` : "";
  }

  override dispose(): void {
    this.batch.remove(this.instance);
    this.root.removeFromParent();
  }
}
