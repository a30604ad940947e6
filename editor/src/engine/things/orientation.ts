/** An orientation of a point: an arrow in the tool direction, whose colour and shape show the reachability. */

import {
  type BufferGeometry,
  ConeGeometry,
  CylinderGeometry,
  Matrix4,
  MeshLambertMaterial,
  Object3D,
  OctahedronGeometry,
  TorusGeometry,
  type Vector3,
} from "three";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import type { Instance } from "../baked";
import type { Batch } from "../batches";
import type { OrientationItem } from "../items";
import { setOrientation } from "../poses";
import { type Context, Thing } from "../thing";

/** Arrow along z, the direction in which tools point, m. */
const LENGTH = 0.05;

function merged(...parts: BufferGeometry[]): BufferGeometry {
  const whole = mergeGeometries(parts.map((part) => (part.index ? part.toNonIndexed() : part)));
  for (const part of parts) part.dispose();
  return whole;
}

const shaft = () => new CylinderGeometry(0.002, 0.002, LENGTH, 6).rotateX(Math.PI / 2).translate(0, 0, LENGTH / 2);

/** Arrowhead; with a ring near a limit, a lump in collision, a bar out of reach. Readable without colours. */
const HEADS: Record<string, () => BufferGeometry> = {
  reachable: () => merged(shaft(), new ConeGeometry(0.006, 0.016, 10).rotateX(Math.PI / 2).translate(0, 0, LENGTH)),
  near_limit: () =>
    merged(
      shaft(),
      new ConeGeometry(0.006, 0.016, 10).rotateX(Math.PI / 2).translate(0, 0, LENGTH),
      new TorusGeometry(0.01, 0.0016, 6, 18).translate(0, 0, LENGTH * 0.6),
    ),
  in_collision: () => merged(shaft(), new OctahedronGeometry(0.009).translate(0, 0, LENGTH)),
  out_of_reach: () =>
    merged(
      shaft(),
      new CylinderGeometry(0.002, 0.002, 0.028, 6).translate(0, 0, LENGTH),
      new CylinderGeometry(0.002, 0.002, 0.028, 6).rotateZ(Math.PI / 2).translate(0, 0, LENGTH),
    ),
};

export class OrientationThing extends Thing<OrientationItem> {
  readonly root = new Object3D();
  item: OrientationItem;
  private batch: Batch | null = null;
  private readonly instance: Instance;

  constructor(item: OrientationItem, context: Context) {
    super(context);
    this.item = item;
    this.instance = { id: item.id, frame: this.root, offset: new Matrix4(), color: context.palette.point };
  }

  update(item: OrientationItem): void {
    this.item = item;
    setOrientation(this.root, item.orientation);
    const known = item.reach in HEADS ? item.reach : "reachable";
    const batch = this.context.batches.of(`orientation ${known}`, () => [
      (HEADS[known] as () => BufferGeometry)(),
      new MeshLambertMaterial(),
    ]);
    if (batch !== this.batch) {
      this.batch?.remove(this.instance);
      batch.add(this.instance);
      this.batch = batch;
    }
    const { palette } = this.context;
    this.instance.color = item.selected ? palette.selected : item.reach ? palette.reach[item.reach] : palette.point;
    const size = item.faint >= 1 ? 0 : item.selected ? 1.3 : 1;
    this.instance.offset.makeScale(size, size, size);
  }

  override anchor(target: Vector3): Vector3 {
    return this.root.localToWorld(target.set(0, 0, LENGTH));
  }

  override dispose(): void {
    this.batch?.remove(this.instance);
    this.root.removeFromParent();
  }
}
