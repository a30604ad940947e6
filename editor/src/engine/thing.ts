/** The model of an item in the view, and what the engine provides for it. */

import { Box3, type Material, type Mesh, type Object3D, Vector3 } from "three";
import type { Telemetry } from "../store/telemetry";
import type { Batches } from "./batches";
import type { Item } from "./items";
import type { Palette } from "./palette";
import type { LowQuality, Quality } from "./surface";

export interface Context {
  telemetry: Telemetry;
  palette: Palette;
  batches: Batches;
  quality: Quality;
  /** The module that draws at low quality; null at high quality. */
  low: LowQuality | null;
  /** Time between two frames during a motion, s. */
  period: number;
  /** Load an asset of the server for display. */
  asset: (id: string) => Promise<ArrayBuffer>;
  /** Report an item that cannot be shown, and the reason. */
  reportFault: (sentence: string) => void;
  /** Return the model with an id. */
  thing: (id: string) => Thing | undefined;
  /** Return the size of a pixel at a point in the world, m. */
  metresPerPixel: (at: Vector3) => number;
  /** Request a new frame. */
  invalidate: () => void;
  /** Call `step` of a model before each frame until it returns false. */
  animate: (thing: Thing) => void;
  /** Report that the model of an item was loaded. */
  loaded: (id: string) => void;
}

export abstract class Thing<I extends Item = Item> {
  /** Its frame, a child of the parent's frame; empty for items drawn by a batch. */
  abstract readonly root: Object3D;
  abstract item: I;

  constructor(protected readonly context: Context) {}

  /** Show another state of the item. */
  abstract update(item: I): void;

  /** Called before each frame, also if only the camera moved. Return whether the size changed. */
  resized(): boolean {
    return false;
  }

  /** Move parts of the model for a time, s. Return whether they move further. */
  step(_seconds: number): boolean {
    return false;
  }

  /** Called after all frames are updated, for models that depend on others. */
  placed(): void {}

  /** Position of the label in the world. */
  anchor(target: Vector3): Vector3 {
    return this.root.getWorldPosition(target);
  }

  /** The reason why the model is not shown; empty if it is shown. */
  get problem(): string {
    return "";
  }

  /** Meaning of the symbol on it; empty without one. */
  get sign(): string {
    return "";
  }

  /** A word next to the name; empty if there is nothing to report. */
  badge(): string {
    return "";
  }

  dispose(): void {
    this.root.removeFromParent();
    disposeTree(this.root);
  }
}

/** Mark an object and its children as the model of an item, for picking. */
export function ownedBy(root: Object3D, id: string): void {
  root.traverse((each) => {
    each.userData.item = id;
  });
}

/** Return the visible meshes of an item, without those of its children. */
export function meshesOf(root: Object3D, id: string, found: Mesh[] = []): Mesh[] {
  for (const child of root.children) {
    const owner = child.userData.item as string | undefined;
    if (!child.visible || (owner !== undefined && owner !== id)) continue;
    if (owner === id && (child as Mesh).isMesh) found.push(child as Mesh);
    meshesOf(child, id, found);
  }
  return found;
}

/** Return the box around an item in the world, without its children; frames have to be up to date. */
export function boundsOf(thing: Thing): Box3 {
  const box = new Box3();
  const part = new Box3();
  for (const mesh of meshesOf(thing.root, thing.item.id)) {
    if (!mesh.geometry.boundingBox) mesh.geometry.computeBoundingBox();
    if (mesh.geometry.boundingBox) box.union(part.copy(mesh.geometry.boundingBox).applyMatrix4(mesh.matrixWorld));
  }
  return thing.item.kind === "logic" ? box : box.expandByPoint(thing.anchor(new Vector3()));
}

/** Return the number of triangles of an item's model, without children and ghosts. */
export function trianglesOf(root: Object3D, id: string): number {
  let count = 0;
  root.traverse((each) => {
    const mesh = each as Mesh;
    if (!mesh.isMesh || each.userData.item !== id) return;
    count += (mesh.geometry.index?.count ?? mesh.geometry.attributes.position?.count ?? 0) / 3;
  });
  return count;
}

/** Make a material transparent or opaque, which changes its shader. */
export function setTransparent(material: Material, on: boolean): void {
  if (material.transparent === on) return;
  material.transparent = on;
  material.needsUpdate = true;
}

/** Free the graphics memory of a tree; shared geometry and materials are marked and kept. */
export function disposeTree(root: Object3D): void {
  root.traverse((each) => {
    const mesh = each as { geometry?: { dispose(): void; userData?: object }; material?: Material | Material[] };
    if (each.userData.shared) return;
    mesh.geometry?.dispose();
    for (const material of [mesh.material ?? []].flat()) material.dispose();
  });
}
