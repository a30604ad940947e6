/** An action point: a ball, drawn with all others at once. */

import { Matrix4, MeshLambertMaterial, Object3D, SphereGeometry, Vector3 } from "three";
import type { Batch, Instance } from "../batches";
import type { PointItem } from "../items";
import { setPosition } from "../poses";
import { Thing, type Context } from "../thing";

const RADIUS = 0.012;

export class PointThing extends Thing<PointItem> {
  readonly root = new Object3D();
  item: PointItem;
  private readonly batch: Batch;
  private readonly instance: Instance;

  constructor(item: PointItem, context: Context) {
    super(context);
    this.item = item;
    this.batch = context.batches.of("point", () => [new SphereGeometry(RADIUS, 14, 10), new MeshLambertMaterial()], RADIUS);
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
    const size = item.faint >= 1 ? 0 : item.size * (item.selected ? 1.4 : 1);
    this.instance.offset.makeScale(size, size, size);
  }

  override anchor(target: Vector3): Vector3 {
    return this.root.getWorldPosition(target);
  }

  override badge(): string {
    return this.item.lockedBy ? `locked by ${this.item.lockedBy}` : "";
  }

  override dispose(): void {
    this.batch.remove(this.instance);
    this.root.removeFromParent();
  }
}
