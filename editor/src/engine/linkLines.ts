/** The lines of all connections, drawn in one call. Loaded with the first line. */

import type { Color, Scene } from "three";
import { persistently } from "../persistently";
import type { Arrow, Line, LinkMesh } from "./linkMesh";

export class LinkLines {
  private readonly lines = new Map<string, Line>();
  private changed = false;
  private mesh: LinkMesh | null = null;
  private pixels = 1;
  private loading: Promise<void> | null = null;

  /** `draw` draws a frame after the first lines were loaded. */
  constructor(
    private readonly scene: Scene,
    private readonly draw: () => void,
  ) {}

  /** Set the height of the view, pixels. */
  set height(pixels: number) {
    this.pixels = pixels;
    if (this.mesh) this.mesh.height = pixels;
  }

  /** Draw a line in a colour; null removes it. */
  set(id: string, arrow: Arrow | null, color: Color): void {
    const before = this.lines.get(id);
    const hex = color.getHexString();
    if (before?.arrow === (arrow ?? undefined) && (!before || before.color === hex)) return;
    this.changed = true;
    if (arrow) this.lines.set(id, { arrow, color: hex });
    else this.lines.delete(id);
  }

  refresh(): void {
    if (!this.changed) return;
    if (!this.mesh) {
      this.loading ??= this.load();
      return;
    }
    this.changed = false;
    this.mesh.show([...this.lines.values()]);
  }

  dispose(): void {
    this.lines.clear();
    this.mesh?.dispose();
  }

  private async load(): Promise<void> {
    const { LinkMesh } = await persistently(() => import("./linkMesh"));
    this.mesh = new LinkMesh(this.scene);
    this.mesh.height = this.pixels;
    this.refresh();
    this.draw();
  }
}
