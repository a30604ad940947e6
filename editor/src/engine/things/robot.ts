/** A robot: its URDF moved by live joints, or a stand-in; a frame at each end effector; grey without a signal. */

import { t } from "@lingui/core/macro";
import {
  AxesHelper,
  CylinderGeometry,
  Group,
  Matrix4,
  Mesh,
  type Object3D,
  Quaternion,
  SphereGeometry,
  Vector3,
} from "three";
import type { URDFRobot } from "urdf-loader";
import { STALE, STILL } from "../../store/telemetry";
import type { RobotItem } from "../items";
import { setPose } from "../poses";
import { surface } from "../surface";
import { type Context, disposeTree, ownedBy, setTransparent, Thing } from "../thing";
import { GhostRobot } from "./ghost";
import type { ToolModel } from "./tool";

/** Limits of a joint, rad; m if prismatic. */
export interface JointLimit {
  name: string;
  lower: number;
  upper: number;
  prismatic: boolean;
}

/** Brightness of a robot whose joints are unknown. */
const GREY = 0.72;
const inverse = new Matrix4();
const tip = new Vector3();
const tipPose = new Matrix4();
const UNIT_SCALE = new Vector3(1, 1, 1);

export class RobotThing extends Thing<RobotItem> {
  readonly root = new Group();
  item: RobotItem;
  /** Null until it is loaded, and if the type has no model. */
  robot: URDFRobot | null = null;
  private readonly body = new Group();
  private readonly tips = new Map<string, Object3D>();
  private readonly shown = new Map<string, number>();
  private readonly material = surface(this.context);
  /** Materials of surfaces with their own colour. */
  private readonly coloured = surface(this.context, { vertexColors: true });
  private reason = "";
  private readonly ghost = new GhostRobot(this.root);
  private tool: ToolModel | null = null;
  private loadingTool = false;
  private urdf: string | null = null;
  private stale = false;

  constructor(item: RobotItem, context: Context) {
    super(context);
    this.item = item;
    this.root.add(this.body);
  }

  update(item: RobotItem): void {
    this.item = item;
    setPose(this.root, item.pose);
    if (item.urdf !== this.urdf) {
      this.urdf = item.urdf;
      void this.load(item.urdf);
    }
    if (this.tool) this.tool.update(item);
    else if ((item.tool || item.parts?.length) && !this.loadingTool) void this.loadTool();
    this.root.visible = item.faint < 1;
    for (const frame of this.tips.values()) frame.visible = item.axes;
    this.ghost.show(item.ghost, this.robot, this.context.palette);
    this.checkAge();
    this.paint();
  }

  /** Joints of the ghost; null without a ghost. */
  ghostJoints(): Record<string, number> | null {
    return this.ghost.joints;
  }

  /** Return the movable joints in the order of the model, with their limits. */
  limits(): JointLimit[] {
    return Object.entries(this.robot?.joints ?? {})
      .filter(([, joint]) => joint.jointType !== "fixed")
      .map(([name, joint]) => {
        const endless = joint.jointType === "continuous";
        const lower = endless ? -2 * Math.PI : Number(joint.limit.lower);
        return {
          name,
          lower,
          upper: endless ? 2 * Math.PI : Number(joint.limit.upper),
          prismatic: joint.jointType === "prismatic",
        };
      });
  }

  /** Return whether the reported joints differ from the shown ones. */
  moved(): boolean {
    const reported = this.context.telemetry.latest(this.item.id)?.joints;
    if (reported && this.robot) {
      for (const [name, value] of reported) {
        if (Math.abs((this.shown.get(name) ?? Infinity) - value) > STILL) return true;
      }
    }
    return this.context.telemetry.endEffectors(this.item.id).some(({ arm_id, end_effector_id, pose }) => {
      const known = this.tips.get(`${arm_id ?? ""}/${end_effector_id}`);
      if (!known) return true;
      const { x, y, z } = pose.position;
      this.root.worldToLocal(tip.set(x, y, z));
      return known.position.distanceToSquared(tip) > STILL * STILL;
    });
  }

  /** Called before a frame if joints or other data have changed. Return whether the motion continues. */
  frame(): boolean {
    this.placeTips();
    const drawn = this.context.telemetry.interpolated(this.item.id, this.context.period);
    if (!drawn || !this.robot) return false;
    const first = this.shown.size === 0;
    let still = true;
    for (const [name, value] of drawn.joints) {
      still &&= this.shown.get(name) === value;
      this.shown.set(name, value);
      this.robot.joints[name]?.setJointValue(value);
    }
    if (first) this.paint();
    // While the robot moves, joints and end effector are reported for different times.
    if (still || !this.tool?.mounted) this.mountTool(this.robot);
    return !drawn.settled;
  }

  override step(seconds: number): boolean {
    return this.tool?.step(seconds) ?? false;
  }

  private async loadTool(): Promise<void> {
    this.loadingTool = true;
    const { ToolModel } = await import("./tool");
    if (this.urdf === null) return; // removed meanwhile
    const { id } = this.item;
    const materials = { plain: this.material, coloured: this.coloured };
    this.tool = new ToolModel(id, this.context, materials, () => this.context.animate(this));
    this.tool.update(this.item);
    if (this.robot) this.mountTool(this.robot);
    this.context.invalidate();
  }

  private mountTool({ links }: URDFRobot): void {
    const [first] = this.context.telemetry.endEffectors(this.item.id);
    const flange = links.flange ?? links.tool0 ?? Object.values(links).at(-1);
    if (!first || !flange || !this.tool) return;
    const { x, y, z, w } = first.pose.orientation;
    tipPose.compose(tip.copy(first.pose.position as Vector3), new Quaternion(x, y, z, w).normalize(), UNIT_SCALE);
    flange.updateWorldMatrix(true, false);
    this.tool?.mount(flange, tipPose);
  }

  /** Check whether the robot still reports. Return whether that changed. */
  checkAge(): boolean {
    const stale = this.item.online && this.context.telemetry.age(this.item.id) > STALE;
    if (stale === this.stale) return false;
    this.stale = stale;
    this.paint();
    return true;
  }

  override anchor(target: Vector3): Vector3 {
    return this.root.getWorldPosition(target).setZ(target.z + 0.02);
  }

  override badge(): string {
    if (this.item.lockedBy) return t`in use by ${this.item.lockedBy}`;
    if (this.stale) return t`no signal: last known pose`;
    return this.reason && (this.robot ? t`partly shown` : t`model cannot be shown`);
  }

  override get problem(): string {
    return this.reason;
  }

  override dispose(): void {
    this.urdf = null;
    this.tool?.dispose();
    this.ghost.dispose();
    super.dispose();
    this.material.dispose();
    this.coloured.dispose();
  }

  private paint(): void {
    const { palette } = this.context;
    const { selected, fault, faint } = this.item;
    const highlight = selected ? palette.selected : fault ? palette.fault : this.stale ? palette.locked : null;
    this.material.color.copy(highlight ?? palette.robot);
    if (highlight) this.coloured.color.copy(highlight);
    else this.coloured.color.setRGB(1, 1, 1);
    // A robot whose joints are unknown is grey. It is not transparent, since its parts would show through each other.
    const unknownPose = this.stale || (this.robot !== null && this.shown.size === 0);
    for (const material of [this.material, this.coloured]) {
      if (unknownPose) material.color.multiplyScalar(GREY);
      setTransparent(material, faint > 0);
      material.opacity = 1 - faint;
    }
  }

  private placeTips(): void {
    const { telemetry } = this.context;
    const seen = new Set<string>();
    for (const { arm_id, end_effector_id, pose } of telemetry.endEffectors(this.item.id)) {
      const key = `${arm_id ?? ""}/${end_effector_id}`;
      seen.add(key);
      let frame = this.tips.get(key);
      if (!frame) {
        frame = new Group().add(new AxesHelper(0.07));
        ownedBy(frame, this.item.id);
        this.tips.set(key, frame);
        this.root.add(frame);
      }
      frame.visible = this.item.axes;
      // End effector poses are reported in the world; the robot's frame may differ.
      setPose(frame, pose);
      frame.updateMatrix();
      inverse
        .copy(this.root.matrixWorld)
        .invert()
        .multiply(frame.matrix)
        .decompose(frame.position, frame.quaternion, frame.scale);
    }
    for (const [key, frame] of this.tips) {
      if (seen.has(key)) continue;
      frame.removeFromParent();
      disposeTree(frame);
      this.tips.delete(key);
    }
  }

  private async load(asset: string): Promise<void> {
    const current = () => this.urdf === asset;
    let robot: URDFRobot | null = null;
    let reason = "";
    if (asset) {
      try {
        const [{ loadRobot }, content] = await Promise.all([import("../loaders/urdf"), this.context.asset(asset)]);
        const loaded = loadRobot(content, { plain: this.material, coloured: this.coloured });
        robot = loaded.robot;
        reason = loaded.problems.join(" ");
      } catch (error) {
        reason = error instanceof Error ? error.message : String(error);
      }
    }
    if (!current()) return;
    this.reason = reason;
    if (reason)
      this.context.reportFault(
        robot
          ? t`Part of ${this.item.name} cannot be shown. ${reason}`
          : t`The model of ${this.item.name} cannot be shown. ${reason}`,
      );
    this.tool?.tip.removeFromParent();
    for (const child of [...this.body.children]) {
      child.removeFromParent();
      disposeTree(child);
    }
    this.robot = robot;
    this.ghost.show(this.item.ghost, robot, this.context.palette);
    this.shown.clear();
    this.body.add(robot ?? this.standIn());
    ownedBy(this.body, this.item.id);
    this.paint();
    this.context.loaded(this.item.id);
  }

  /** A foot and a column that mark a robot whose type has no model. */
  private standIn(): Object3D {
    const foot = new Mesh(
      new CylinderGeometry(0.09, 0.1, 0.05, 32).rotateX(Math.PI / 2).translate(0, 0, 0.025),
      this.material,
    );
    const column = new Mesh(
      new CylinderGeometry(0.055, 0.065, 0.14, 32).rotateX(Math.PI / 2).translate(0, 0, 0.12),
      this.material,
    );
    const head = new Mesh(new SphereGeometry(0.07, 24, 16).translate(0, 0, 0.2), this.material);
    return new Group().add(foot, column, head);
  }
}
