/** The gripper at the flange of a robot, and the parts that it carries. */

import {
  BoxGeometry,
  type BufferGeometry,
  CylinderGeometry,
  Group,
  Matrix4,
  Mesh,
  type Object3D,
  SphereGeometry,
} from "three";
import type { CarriedItem, RobotItem, Shape } from "../items";
import type { DeviceModel } from "../models";
import { setPose } from "../poses";
import type { surface } from "../surface";
import { type Context, ownedBy } from "../thing";

/** Distances of the tip from the flange for which the model of a gripper is stretched, m. */
const SHORTEST = 0.06;
const LONGEST = 0.4;
const inverse = new Matrix4();

export class ToolModel {
  /** At the tool centre point, a child of the flange. */
  readonly tip = new Group();
  private readonly gripper = new Group();
  private readonly carried = new Group();
  private icon = "";
  private model: DeviceModel | null = null;
  private parts: RobotItem["parts"];
  private tool: RobotItem["tool"];

  constructor(
    private readonly id: string,
    private readonly context: Context,
    private readonly materials: { plain: ReturnType<typeof surface>; coloured: ReturnType<typeof surface> },
    private readonly animate: () => void,
  ) {
    this.tip.add(this.gripper, this.carried);
    this.tip.visible = false;
  }

  update({ tool, parts }: RobotItem): void {
    if (parts !== this.parts) this.carry(parts);
    if (tool === this.tool) return;
    this.tool = tool;
    if ((tool?.icon ?? "") !== this.icon) {
      this.icon = tool?.icon ?? "";
      this.clear(this.gripper);
      this.model = null;
      if (tool) void this.load(tool.icon);
    }
    this.model?.show(tool?.values ?? {});
    this.animate();
  }

  step(seconds: number): boolean {
    return this.model?.step(seconds) ?? false;
  }

  /** Attach the model to the flange so that it ends at the tip. */
  mount(flange: Object3D, tipInWorld: Matrix4): void {
    if (this.tip.parent !== flange) flange.add(this.tip);
    inverse.copy(flange.matrixWorld).invert().multiply(tipInWorld);
    inverse.decompose(this.tip.position, this.tip.quaternion, this.tip.scale);
    this.tip.scale.set(1, 1, 1);
    this.stretch();
    this.tip.visible = true;
  }

  /** Stretch the model from the flange to the tip. */
  private stretch(): void {
    if (!this.model) return;
    const length = this.tip.position.length();
    this.gripper.scale.z = length > SHORTEST && length < LONGEST ? length / this.model.length : 1;
    this.gripper.position.z = -this.model.length * this.gripper.scale.z;
  }

  get mounted(): boolean {
    return this.tip.visible;
  }

  dispose(): void {
    this.icon = "";
    this.tip.removeFromParent();
    this.clear(this.gripper);
    this.clear(this.carried);
  }

  private async load(icon: string): Promise<void> {
    const model = await import("../models").then(
      ({ modelOf }) => modelOf(icon),
      () => null,
    );
    if (icon !== this.icon || !model) return;
    this.model = model;
    this.add(this.gripper, model.body);
    for (const part of model.moving) part.object = this.add(this.gripper, part.geometry);
    model.show(this.tool?.values ?? {});
    model.step(Infinity);
    this.stretch();
    this.context.invalidate();
  }

  private carry(parts: readonly CarriedItem[] | undefined): void {
    this.parts = parts;
    this.clear(this.carried);
    for (const { pose, shape } of parts ?? []) {
      const geometry = solid(shape);
      if (geometry) setPose(this.add(this.carried, geometry), pose);
    }
    this.context.invalidate();
  }

  private add(to: Group, geometry: BufferGeometry): Mesh {
    const mesh = new Mesh(geometry, geometry.hasAttribute("color") ? this.materials.coloured : this.materials.plain);
    mesh.castShadow = true;
    ownedBy(mesh, this.id);
    to.add(mesh);
    return mesh;
  }

  private clear(group: Group): void {
    for (const each of [...group.children]) {
      each.removeFromParent();
      each.userData.shared = true; // the materials belong to the robot
      (each as Mesh).geometry.dispose();
    }
  }
}

function solid(shape: Shape): BufferGeometry | null {
  switch (shape.kind) {
    case "box":
      return new BoxGeometry(...shape.size);
    case "cylinder":
      return new CylinderGeometry(shape.radius, shape.radius, shape.height, 32).rotateX(Math.PI / 2);
    case "sphere":
      return new SphereGeometry(shape.radius, 32, 20);
    default:
      return null;
  }
}
