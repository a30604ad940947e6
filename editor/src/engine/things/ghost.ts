/** The ghost: a transparent robot in another colour that shows a possible pose. */

import { Group, type Material, Matrix4, type Mesh, MeshLambertMaterial } from "three";
import type { URDFRobot } from "urdf-loader";
import type { Pose } from "../../protocol/types";
import type { RobotItem } from "../items";
import type { Palette } from "../palette";
import { setPose } from "../poses";

const inverse = new Matrix4();

export class GhostRobot {
  private robot: URDFRobot | null = null;
  private of: URDFRobot | null = null;
  /** Pose of its base. */
  private readonly frame = new Group();
  private readonly material = new MeshLambertMaterial({ transparent: true, opacity: 0.45, depthWrite: false });

  constructor(private readonly host: Group) {}

  /** Show the ghost, or hide it; `model` is the robot that it copies. */
  show(ghost: RobotItem["ghost"], model: URDFRobot | null, palette: Palette): void {
    if (this.robot && (!ghost || this.of !== model)) this.remove();
    if (!ghost || !model) return;
    if (!this.robot) {
      this.of = model;
      this.robot = model.clone() as URDFRobot;
      this.robot.traverse((each) => {
        // The geometry belongs to the model; ghosts cannot be picked.
        each.userData = { shared: true };
        each.raycast = () => {};
        const mesh = each as Mesh<never, Material>;
        if (!mesh.isMesh) return;
        mesh.material = this.material;
        mesh.castShadow = false;
      });
      this.frame.add(this.robot);
      this.host.add(this.frame);
    }
    this.place(ghost.at);
    // Its colour differs from that of a selected robot.
    this.material.color.copy(ghost.at ? palette.point : ghost.possible ? palette.selected : palette.fault);
    for (const [name, value] of Object.entries(ghost.joints)) this.robot.joints[name]?.setJointValue(value);
  }

  /** Return what it shows, for tests. */
  get joints(): Record<string, number> | null {
    return (
      this.robot &&
      Object.fromEntries(Object.entries(this.robot.joints).map(([name, joint]) => [name, Number(joint.angle)]))
    );
  }

  dispose(): void {
    this.remove();
    this.material.dispose();
  }

  /** Move its base to a pose in the world, or to that of the robot. */
  private place(at: Pose | undefined): void {
    const { frame, host } = this;
    frame.position.set(0, 0, 0);
    frame.quaternion.identity();
    if (!at) return;
    setPose(frame, at);
    frame.updateMatrix();
    host.updateWorldMatrix(true, false);
    inverse
      .copy(host.matrixWorld)
      .invert()
      .multiply(frame.matrix)
      .decompose(frame.position, frame.quaternion, frame.scale);
  }

  private remove(): void {
    this.frame.removeFromParent();
    this.robot?.removeFromParent();
    this.robot = null;
    this.of = null;
  }
}
