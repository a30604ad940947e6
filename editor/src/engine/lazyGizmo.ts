/** The gizmo of the transform tool: moves, turns and resizes an item. It is loaded when it is first shown. */

import { persistently } from "../persistently";
import type { Drag, Gizmo, GizmoSetup, Surroundings } from "./gizmo/gizmo";

export class LazyGizmo {
  /** Called during a drag. */
  onDrag: (drag: Drag) => void = () => {};

  private gizmo: Gizmo | null = null;
  private wanted: GizmoSetup | null = null;
  private ended = false;

  constructor(private readonly around: Surroundings) {}

  show(setup: GizmoSetup): void {
    this.wanted = setup;
    if (this.gizmo) this.gizmo.show(setup);
    else void this.load();
  }

  hide(): void {
    this.wanted = null;
    this.gizmo?.hide();
  }

  get shown(): boolean {
    return this.gizmo?.shown ?? false;
  }

  get isDragging(): boolean {
    return this.gizmo?.isDragging ?? false;
  }

  places(): ReturnType<Gizmo["places"]> {
    return this.gizmo?.places() ?? {};
  }

  place(): void {
    this.gizmo?.place();
  }

  dispose(): void {
    this.ended = true;
    this.gizmo?.dispose();
  }

  private async load(): Promise<void> {
    const { Gizmo } = await persistently(() => import("./gizmo/gizmo"));
    if (this.ended || this.gizmo || !this.wanted) return;
    this.gizmo = new Gizmo(this.around);
    this.gizmo.onDrag = (drag) => this.onDrag(drag);
    this.gizmo.show(this.wanted);
  }
}
