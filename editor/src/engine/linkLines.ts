/** The lines of all connections in one draw call: hundreds of meshes take most of the time of a frame. */

import { BufferAttribute, BufferGeometry, type Color, Mesh, MeshBasicMaterial, type Scene } from "three";

interface Line {
  geometry: BufferGeometry;
  color: string;
  rgb: readonly [number, number, number];
}

export class LinkLines {
  readonly mesh = new Mesh(new BufferGeometry(), new MeshBasicMaterial({ vertexColors: true }));
  private readonly lines = new Map<string, Line>();
  private changed = false;

  constructor(scene: Scene) {
    this.mesh.raycast = () => {}; // the meshes of the connections are picked
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    scene.add(this.mesh);
  }

  /** Draw a line in a colour, or no longer. Its geometry has an index. */
  set(id: string, geometry: BufferGeometry | null, color: Color): void {
    const before = this.lines.get(id);
    const hex = color.getHexString();
    if (before?.geometry === (geometry ?? undefined) && (!before || before.color === hex)) return;
    this.changed = true;
    if (geometry) this.lines.set(id, { geometry, color: hex, rgb: [color.r, color.g, color.b] });
    else this.lines.delete(id);
  }

  refresh(): void {
    if (!this.changed) return;
    this.changed = false;
    const lines = [...this.lines.values()];
    const sum = (of: (line: Line) => number) => lines.reduce((total, line) => total + of(line), 0);
    const vertices = sum(({ geometry }) => geometry.getAttribute("position").count);
    const places = new Float32Array(vertices * 3);
    const colors = new Float32Array(vertices * 3);
    const index = new Uint32Array(sum(({ geometry }) => geometry.index?.count ?? 0));
    let vertex = 0;
    let corner = 0;
    for (const { geometry, rgb } of lines) {
      const position = geometry.getAttribute("position");
      places.set(position.array, vertex * 3);
      for (let n = 0; n < position.count; n++) colors.set(rgb, (vertex + n) * 3);
      for (const one of geometry.index?.array ?? []) index[corner++] = one + vertex;
      vertex += position.count;
    }
    this.mesh.geometry.dispose();
    this.mesh.geometry = new BufferGeometry()
      .setAttribute("position", new BufferAttribute(places, 3))
      .setAttribute("color", new BufferAttribute(colors, 3))
      .setIndex(new BufferAttribute(index, 1));
    this.mesh.visible = vertices > 0;
  }

  dispose(): void {
    this.mesh.removeFromParent();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }
}
