/** The picture of one item, and what it is given by the engine. */

import type { Material, Mesh, Object3D, Vector3 } from "three";
import type { Telemetry } from "../store/telemetry";
import type { Batches } from "./batches";
import type { Item } from "./items";
import type { Palette } from "./palette";
import type { Quality } from "./surface";

export interface Context {
  telemetry: Telemetry;
  palette: Palette;
  batches: Batches;
  quality: Quality;
  /** s between two frames while something moves. */
  period: number;
  /** Read an asset of the server, ready to be shown. */
  asset: (id: string) => Promise<ArrayBuffer>;
  /** Tell people what cannot be shown, and why. */
  trouble: (sentence: string) => void;
  /** The thing with an id, for what connects two. */
  thing: (id: string) => Thing | undefined;
  /** m in the world that one pixel is worth at a place. */
  metresPerPixel: (at: Vector3) => number;
  /** Something has to be drawn anew. */
  invalidate: () => void;
  /** A shape came that was being loaded. */
  loaded: () => void;
}

export abstract class Thing<I extends Item = Item> {
  /** Its frame, a child of its parent's; things that are drawn by a batch have nothing in it. */
  abstract readonly root: Object3D;
  abstract item: I;

  constructor(protected readonly context: Context) {}

  /** Show another state of the item. */
  abstract update(item: I): void;

  /** Called before each drawn frame, also when only the camera moved: gives whether it has another size now. */
  resized(): boolean {
    return false;
  }

  /** Called after all frames are known, for what depends on where others are. */
  placed(): void {}

  /** Where its label stands, in the world. */
  anchor(target: Vector3): Vector3 {
    return this.root.getWorldPosition(target);
  }

  /** Why it is not shown as it looks; empty where it is. */
  get problem(): string {
    return "";
  }

  /** What the sign on it tells by its shape; empty where there is none. */
  get sign(): string {
    return "";
  }

  /** A word beside the name, when something is to be told. */
  badge(): string {
    return "";
  }

  dispose(): void {
    this.root.removeFromParent();
    disposeTree(this.root);
  }
}

/** Mark an object and what is below it as the picture of an item, for picking. */
export function ownedBy(root: Object3D, id: string): void {
  root.traverse((each) => {
    each.userData.item = id;
  });
}

/** Count the triangles of an item's picture; not those of what hangs on it, nor of doubles. */
export function trianglesOf(root: Object3D, id: string): number {
  let count = 0;
  root.traverse((each) => {
    const mesh = each as Mesh;
    if (!mesh.isMesh || each.userData.item !== id) return;
    count += (mesh.geometry.index?.count ?? mesh.geometry.getAttribute("position").count) / 3;
  });
  return count;
}

/** Let a material be seen through, or not: its shader is another one then. */
export function seenThrough(material: Material, on: boolean): void {
  if (material.transparent === on) return;
  material.transparent = on;
  material.needsUpdate = true;
}

/** Free what the graphics card holds of a tree; shared geometry and material are marked and stay. */
export function disposeTree(root: Object3D): void {
  root.traverse((each) => {
    const mesh = each as { geometry?: { dispose(): void; userData?: object }; material?: Material | Material[] };
    if (each.userData.shared) return;
    mesh.geometry?.dispose();
    for (const material of [mesh.material ?? []].flat()) material.dispose();
  });
}
