/** An object of the scene: its collision model, or a marker. */

import { t } from "@lingui/core/macro";
import {
  AxesHelper,
  BoxGeometry,
  type BufferGeometry,
  CylinderGeometry,
  EdgesGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  OctahedronGeometry,
  SphereGeometry,
  type Vector3,
} from "three";
import type { ObjectItem, Shape } from "../items";
import { readMesh } from "../loaders/glb";
import type { DeviceModel } from "../models";
import type { Parts } from "../parts";
import { setPose } from "../poses";
import { surface } from "../surface";
import { type Context, disposeTree, ownedBy, setTransparent, Thing } from "../thing";

/** Colour of detected parts. */
const PART = 0x2f8f5b;

export class ObjectThing extends Thing<ObjectItem> {
  readonly root = new Group();
  item: ObjectItem;
  private shape = "";
  private readonly material = surface(this.context);
  private readonly edges = new LineBasicMaterial({ transparent: true, opacity: 0.35 });
  /** Counts models, so that a mesh that loads late does not replace a newer one. */
  private loading = 0;
  private height = 0.05;
  private coloured = false;
  private reason = "";
  private model: DeviceModel | null = null;
  private values: ObjectItem["values"];
  /** Loaded for the first object with sensors. */
  private parts: Parts | null = null;
  private readonly partMaterial = surface(this.context, { color: PART });

  constructor(item: ObjectItem, context: Context) {
    super(context);
    this.item = item;
  }

  update(item: ObjectItem): void {
    this.item = item;
    setPose(this.root, item.pose);
    const shape = JSON.stringify(item.shape);
    if (shape !== this.shape) {
      this.shape = shape;
      this.build(item.shape);
    }
    if (item.parts || this.parts) void this.showParts();
    if (item.values !== this.values) this.showValues(item);
    const { palette } = this.context;
    const color = item.selected
      ? palette.selected
      : item.fault || this.reason
        ? palette.fault
        : item.lockedBy
          ? palette.locked
          : null;
    // A mesh keeps its own colours unless it is highlighted.
    if (color || !this.coloured) this.material.color.copy(color ?? palette.object);
    else this.material.color.setRGB(1, 1, 1);
    this.edges.color.copy(item.selected ? palette.selected : palette.gridStrong);
    setTransparent(this.material, item.faint > 0);
    this.material.opacity = 1 - item.faint;
    this.material.depthWrite = item.faint < 0.5;
    this.root.visible = item.faint < 1;
  }

  override anchor(target: Vector3): Vector3 {
    return this.root.getWorldPosition(target).setZ(target.z + this.height);
  }

  override badge(): string {
    if (this.item.lockedBy) return t`in use by ${this.item.lockedBy}`;
    return this.reason && t`model cannot be shown`;
  }

  override get problem(): string {
    return this.reason;
  }

  override step(seconds: number): boolean {
    const glides = this.parts?.step(seconds);
    return this.model?.step(seconds) || glides || false;
  }

  override dispose(): void {
    this.loading++;
    super.dispose();
    this.material.dispose();
    this.edges.dispose();
    this.parts?.dispose();
    this.partMaterial.dispose();
  }

  /** Show the parts that sensors detect on it. */
  private async showParts(): Promise<void> {
    if (!this.parts) {
      const { Parts } = await import("../parts");
      this.parts ??= new Parts(this.root, this.partMaterial);
    }
    const { parts = [], values } = this.item;
    if (this.parts.show(parts, values?.velocity ?? 0)) this.context.animate(this);
    this.context.invalidate();
  }

  private build(shape: Shape): void {
    const mine = ++this.loading;
    this.reason = "";
    this.model = null;
    for (const child of [...this.root.children]) {
      // Children of the item stay.
      if (child.userData.item !== this.item.id) continue;
      child.removeFromParent();
      disposeTree(child);
    }
    switch (shape.kind) {
      case "box":
        return this.show(new BoxGeometry(...shape.size));
      case "cylinder":
        return this.show(new CylinderGeometry(shape.radius, shape.radius, shape.height, 32).rotateX(Math.PI / 2));
      case "sphere":
        return this.show(new SphereGeometry(shape.radius, 32, 20));
      case "none": {
        if (shape.icon) return void this.device(shape.icon, mine);
        return this.marker();
      }
      case "mesh":
        void this.load(shape.asset, mine);
    }
  }

  private marker(): void {
    const axes = new AxesHelper(0.08);
    ownedBy(axes, this.item.id);
    this.root.add(axes);
    this.show(new OctahedronGeometry(0.03));
  }

  /** Show the model for an icon; a marker if there is none. */
  private async device(icon: string, mine: number): Promise<void> {
    const model = await import("../models").then(
      ({ modelOf, lampsOf }) => modelOf(icon, lampsOf(this.item.values)),
      () => null,
    );
    if (mine !== this.loading) {
      model?.body.dispose();
      for (const { geometry } of model?.moving ?? []) geometry.dispose();
      return;
    }
    if (model) this.showModel(model);
    else this.marker();
    this.context.loaded(this.item.id);
  }

  private showModel(model: DeviceModel): void {
    this.model = model;
    this.show(model.body, model.top);
    for (const part of model.moving) {
      part.object = new Mesh(part.geometry, this.material);
      part.object.castShadow = part.object.receiveShadow = true;
      ownedBy(part.object, this.item.id);
      this.root.add(part.object);
    }
    this.showValues(this.item);
    this.step(Infinity);
  }

  /** Show what the device reports. A tower light is built of the lamps that it reports. */
  private showValues(item: ObjectItem): void {
    this.values = item.values;
    if (!this.model) return;
    if (item.values && !this.model.fits(item.values)) return this.build(item.shape);
    this.model.show(item.values ?? {});
    this.context.animate(this);
  }

  private async load(asset: string, mine: number): Promise<void> {
    try {
      const geometry = readMesh(await this.context.asset(asset));
      if (mine !== this.loading) return geometry.dispose();
      this.show(geometry);
      this.context.loaded(this.item.id);
    } catch (error) {
      if (mine !== this.loading) return;
      this.reason = error instanceof Error ? error.message : String(error);
      this.context.reportFault(t`The model of ${this.item.name} cannot be shown. ${this.reason}`);
      this.show(new OctahedronGeometry(0.06));
    }
  }

  private show(geometry: BufferGeometry, top?: number): void {
    const coloured = geometry.hasAttribute("color");
    if (coloured !== this.coloured) {
      this.coloured = this.material.vertexColors = coloured;
      this.material.needsUpdate = true;
    }
    this.update(this.item);
    const mesh = new Mesh(geometry, this.material);
    mesh.castShadow = mesh.receiveShadow = true;
    geometry.computeBoundingBox();
    // A tap on the label's place hits the surface.
    this.height = top ?? Math.max(0.02, geometry.boundingBox?.max.z ?? 0);
    const count = geometry.index?.count ?? geometry.getAttribute("position").count;
    // Edges make shapes readable without shadows; dense meshes would have too many.
    if (count < 3000) mesh.add(new LineSegments(new EdgesGeometry(geometry, 30), this.edges));
    ownedBy(mesh, this.item.id);
    this.root.add(mesh);
    this.context.invalidate();
  }
}
