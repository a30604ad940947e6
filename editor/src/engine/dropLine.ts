/** Height of an item: a dashed line down to the floor with a ring at its end. A separate chunk. */

import {
  BufferGeometry,
  Group,
  LineDashedMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  RingGeometry,
  type Scene,
  Vector3,
} from "three";
import type { Palette } from "./palette";

export class DropLine {
  private readonly root = new Group();
  private readonly line = new LineSegments(
    new BufferGeometry().setFromPoints([new Vector3(), new Vector3(0, 0, -1)]),
    new LineDashedMaterial({ dashSize: 0.02, gapSize: 0.015, transparent: true, opacity: 0.9 }),
  );
  private readonly ring = new Mesh(
    new RingGeometry(0.03, 0.036, 32),
    new MeshBasicMaterial({ transparent: true, opacity: 0.8 }),
  );

  constructor(scene: Scene) {
    this.root.userData.ground = true; // not pickable
    this.root.add(this.line, this.ring);
    this.root.visible = false;
    scene.add(this.root);
  }

  /** Show the line below a point in the world; null hides it. */
  show(at: Vector3 | null, palette: Palette): void {
    this.root.visible = at !== null;
    if (!at) return;
    this.line.material.color.copy(palette.selected);
    this.ring.material.color.copy(palette.selected);
    this.line.position.copy(at);
    this.line.scale.set(1, 1, at.z);
    // Dash lengths apply before scaling.
    this.line.material.scale = Math.abs(at.z);
    this.line.computeLineDistances();
    this.ring.position.set(at.x, at.y, 0.001);
    this.root.updateMatrixWorld(true);
  }

  dispose(): void {
    this.root.removeFromParent();
    this.line.geometry.dispose();
    this.line.material.dispose();
    this.ring.geometry.dispose();
    this.ring.material.dispose();
  }
}
