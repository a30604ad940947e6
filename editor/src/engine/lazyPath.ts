/** The straight path of the tool. The module that draws it is loaded on first use. */

import type { Scene } from "three";
import { persistently } from "../persistently";
import type { Palette } from "./palette";
import type { PathLine, StraightPath } from "./pathLine";

export class LazyPath {
  private line: PathLine | null = null;
  private wanted: StraightPath | null = null;

  constructor(
    private readonly scene: Scene,
    private readonly draw: () => void,
  ) {}

  async show(path: StraightPath | null, palette: Palette): Promise<void> {
    this.wanted = path;
    if (!path && !this.line) return;
    const { PathLine } = await persistently(() => import("./pathLine"));
    this.line ??= new PathLine(this.scene);
    if (this.line.show(this.wanted, palette)) this.draw();
  }

  get shown(): StraightPath | null {
    return this.line?.shown ?? null;
  }

  dispose(): void {
    this.line?.dispose();
  }
}
