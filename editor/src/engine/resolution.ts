/**
 * Whether the camera moves, and the resolution of the picture. At low quality it is halved during motion, because
 * pixels cost most of a frame.
 */

import { type Camera, Matrix4 } from "three";

/** Part of the resolution while the camera moves. */
const MOVING = 0.5;
/** Time without a motion after which the picture has the full resolution, ms: longer than a slow frame. */
const REST = 300;

export class Resolution {
  private readonly last = new Matrix4();
  private size: [number, number] = [1, 1];
  private part = 1;
  private movedAt = -Infinity;
  private timer: ReturnType<typeof setTimeout> | undefined;
  /** Number of frames since the motion began. */
  private steps = 0;

  /** `apply` changes the size of the canvas, pixels; `draw` requests a frame. */
  constructor(
    private readonly changes: boolean,
    private readonly apply: (width: number, height: number) => void,
    private readonly draw: () => void,
  ) {}

  resize(width: number, height: number): void {
    this.size = [width, height];
    this.set(this.part, true);
  }

  /** Called before each frame. A single jump of the camera keeps the full resolution. */
  follow({ matrixWorld }: Camera, now = performance.now()): void {
    const rested = now - this.movedAt >= REST;
    if (this.last.equals(matrixWorld)) {
      if (rested) this.full();
      return;
    }
    this.last.copy(matrixWorld);
    this.steps = rested ? 0 : this.steps + 1;
    if (this.changes && this.steps > 0) this.set(MOVING);
    this.movedAt = now;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.steps > 0 && this.draw(), REST);
  }

  /** Whether the camera moves continuously; a frame follows after the motion. */
  get moving(): boolean {
    return this.steps > 1;
  }

  /** Draw the next frame in full resolution. */
  full(): void {
    this.steps = 0;
    this.set(1);
  }

  dispose(): void {
    clearTimeout(this.timer);
  }

  private set(part: number, resized = false): void {
    if (part === this.part && !resized) return;
    this.part = part;
    const [width, height] = this.size;
    this.apply(Math.max(1, Math.round(width * part)), Math.max(1, Math.round(height * part)));
  }
}
