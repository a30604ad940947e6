/** Lines from points to their parents, in one draw call. */

import {
  BufferAttribute,
  BufferGeometry,
  DynamicDrawUsage,
  LineBasicMaterial,
  LineSegments,
  type Scene,
  Vector3,
} from "three";
import type { Palette } from "./palette";
import type { Thing } from "./thing";

const place = new Vector3();

export class ParentLines {
  private readonly lines = new LineSegments(
    new BufferGeometry(),
    new LineBasicMaterial({ transparent: true, opacity: 0.75 }),
  );
  private capacity = 0;
  /** Number of lines. */
  count = 0;

  constructor(scene: Scene) {
    this.lines.userData.ground = true; // not pickable
    this.lines.frustumCulled = false;
    this.lines.visible = false;
    scene.add(this.lines);
  }

  /** Draw a line from each point to the origin of its parent. */
  show(things: ReadonlyMap<string, Thing>, palette: Palette): void {
    const ends = [...things.values()].flatMap(({ item, root }) => {
      const parent = item.kind === "point" && item.tied && item.faint < 1 && things.get(item.parent ?? "");
      return parent ? [root, parent.root] : [];
    });
    this.count = ends.length / 2;
    this.lines.visible = ends.length > 0;
    if (ends.length === 0) return;
    this.lines.material.color.copy(palette.point);
    if (ends.length > this.capacity) {
      this.capacity = ends.length * 2;
      this.lines.geometry.dispose();
      const places = new BufferAttribute(new Float32Array(this.capacity * 3), 3);
      places.setUsage(DynamicDrawUsage);
      this.lines.geometry = new BufferGeometry().setAttribute("position", places);
    }
    const places = this.lines.geometry.getAttribute("position") as BufferAttribute;
    ends.forEach((end, n) => {
      const { x, y, z } = end.getWorldPosition(place);
      places.setXYZ(n, x, y, z);
    });
    places.needsUpdate = true;
    this.lines.geometry.setDrawRange(0, ends.length);
  }

  dispose(): void {
    this.lines.removeFromParent();
    this.lines.geometry.dispose();
    this.lines.material.dispose();
  }
}
