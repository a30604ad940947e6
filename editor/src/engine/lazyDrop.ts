/** Height of the selected item, and the line below it. The module that draws the line is loaded on first use. */

import { t } from "@lingui/core/macro";
import { type Scene, Vector3 } from "three";
import { persistently } from "../persistently";
import type { DropLine } from "./dropLine";
import type { Palette } from "./palette";
import type { Thing } from "./thing";

/** Lowest height that is shown, m. */
const LOW = 0.005;

export class LazyDrop {
  private line: DropLine | null = null;
  private loading = false;
  private readonly at = new Vector3();

  constructor(
    private readonly scene: Scene,
    private readonly draw: () => void,
  ) {}

  /** Show the line below the selected item, and write its height to the notes by item. */
  update(things: Iterable<Thing>, palette: Palette, notes: Map<string, string>): void {
    notes.clear();
    let chosen: Thing | undefined;
    for (const each of things) if (each.item.selected && each.item.kind !== "logic") chosen ??= each;
    const shown = chosen && chosen.item.faint < 1;
    if (shown) chosen?.root.getWorldPosition(this.at);
    const height = shown ? this.at.z : 0;
    if (chosen) notes.set(chosen.item.id, heightText(height));
    const raised = Math.abs(height) > LOW;
    if (this.line) this.line.show(raised ? this.at : null, palette);
    else if (raised && !this.loading) void this.load();
  }

  dispose(): void {
    this.loading = true;
    this.line?.dispose();
  }

  private async load(): Promise<void> {
    this.loading = true;
    const { DropLine } = await persistently(() => import("./dropLine"));
    this.line = new DropLine(this.scene);
    this.draw();
  }
}

/** Return a height as text, mm. */
function heightText(z: number): string {
  if (Math.abs(z) <= LOW) return "";
  const height = Math.round(Math.abs(z) * 1000);
  return z > 0 ? t`${height} mm above the floor` : t`${height} mm below the floor`;
}
