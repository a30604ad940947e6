/** Fit the view to the items, also when their models appear a little later. */

import type { Vector3 } from "three";
import type { View } from "./camera";
import { corners } from "./framing";
import type { Item } from "./items";
import { boundsOf, type Thing } from "./thing";

/** Time after a fit within which added devices belong to it, ms. On a slow network, their poses arrive late. */
const SOON = 8000;

export class Fitting {
  /** Position of the camera after the last fit to all items. */
  private fitted: Vector3 | null = null;
  private fittedAt = -Infinity;
  /** Items of that fit whose models may not be loaded yet. */
  private awaited = new Set<string>();

  constructor(
    private readonly view: View,
    private readonly things: ReadonlyMap<string, Thing>,
  ) {}

  /** Bring these or all items into the view. Frames have to be up to date. */
  focus(ids?: readonly string[], best = false): void {
    this.fit(ids, best);
    this.awaited = new Set(ids ? [] : this.things.keys());
    this.fittedAt = performance.now();
  }

  /** Fit the view to all items again, unless the user has moved the camera. */
  refit(): void {
    if (this.fitted && this.fitted.distanceTo(this.view.camera.position) < 1e-6) this.fit();
  }

  /** Handle an added item: a device that is added soon after a fit belongs to that fit. */
  added({ kind, id }: Item): void {
    if (kind === "object" && performance.now() - this.fittedAt < SOON) this.awaited.add(id);
  }

  /** Handle a loaded model: fit the view again if the last fit waits for it. Later ones do not move the camera. */
  loaded(id: string): void {
    if (this.awaited.delete(id)) this.refit();
  }

  private fit(ids?: readonly string[], best = false): void {
    const boxes = [...this.things.values()]
      .filter(({ item }) => (ids ? ids.includes(item.id) : item.faint < 1))
      .map((thing) => boundsOf(thing).expandByScalar(ids ? 0.12 : 0.01));
    this.view.fit(corners(boxes), best);
    this.fitted = ids ? null : this.view.camera.position.clone();
  }
}
