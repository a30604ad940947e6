/** Animate models with moving parts: before each frame, until the parts have reached their reported positions. */

import type { Quality } from "./surface";
import type { Thing } from "./thing";

/** Longest time of a step, s, so that no part jumps after a pause. */
const LONGEST = 0.1;

export class Animation {
  private readonly moving = new Set<Thing>();
  private readonly reducedMotion = window.matchMedia("(prefers-reduced-motion: reduce)");

  /** `draw` requests a frame, `changed` a frame in which everything is placed again. */
  constructor(
    private readonly quality: Quality,
    private readonly draw: () => void,
    private readonly changed: () => void,
  ) {}

  /** Move the parts of a model; at once at low quality, or if the user wants no motion. */
  add(thing: Thing): void {
    if (this.quality === "low" || this.reducedMotion.matches) {
      thing.step(Infinity);
      return this.changed();
    }
    this.moving.add(thing);
    this.draw();
  }

  remove(thing: Thing): void {
    this.moving.delete(thing);
  }

  /** Move all parts for a time, s. Return whether a frame is needed after this one. */
  step(seconds: number): boolean {
    for (const thing of this.moving) {
      if (!thing.step(Math.min(seconds, LONGEST))) this.moving.delete(thing);
      thing.root.updateMatrixWorld();
    }
    return this.moving.size > 0;
  }
}
