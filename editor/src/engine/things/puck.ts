/** An action: a disc above its point, stacked when there are several. START and END stand where people put them. */

import { CylinderGeometry, Matrix4, MeshLambertMaterial, Object3D, Vector3 } from "three";
import type { Batch, Instance } from "../batches";
import type { PuckItem } from "../items";
import { Thing, type Context } from "../thing";

/** m: height of the first puck above its point, and from one to the next. */
const FIRST = 0.035;
const NEXT = 0.022;
const up = new Vector3();

export class PuckThing extends Thing<PuckItem> {
  readonly root = new Object3D();
  item: PuckItem;
  private readonly batch: Batch;
  private readonly instance: Instance;

  constructor(item: PuckItem, context: Context) {
    super(context);
    this.item = item;
    const edge = item.role === "action";
    this.batch = context.batches.of(edge ? "puck" : "start and end", () => [
      (edge ? new CylinderGeometry(0.018, 0.018, 0.01, 24) : new CylinderGeometry(0.03, 0.03, 0.014, 6)).rotateX(Math.PI / 2),
      new MeshLambertMaterial(),
    ]);
    this.instance = { id: item.id, frame: this.root, offset: new Matrix4(), color: context.palette.point };
    this.batch.add(this.instance);
  }

  update(item: PuckItem): void {
    this.item = item;
    if (item.position) this.root.position.set(item.position.x, item.position.y, item.position.z);
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
    const size = item.faint >= 1 ? 0 : item.selected || item.running ? 1.25 : 1;
    this.instance.offset.makeScale(size, size, size);
  }

  /** Above the point in the world, however the point's parent is turned. */
  override placed(): void {
    if (this.item.position || !this.root.parent) return;
    this.root.parent.getWorldPosition(up).z += FIRST + this.item.level * NEXT;
    this.root.matrixAutoUpdate = false;
    this.root.matrixWorldAutoUpdate = false;
    this.root.matrixWorld.makeTranslation(up);
  }

  override anchor(target: Vector3): Vector3 {
    return target.setFromMatrixPosition(this.root.matrixWorld);
  }

  override dispose(): void {
    this.batch.remove(this.instance);
    this.root.removeFromParent();
  }
}
