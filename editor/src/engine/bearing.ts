/** Position of an item in the view, or the direction to it. Works without loading the engine. */

import { type PerspectiveCamera, Vector3 } from "three";
import type { Engine } from "./engine";

interface Bearing {
  /** Pixels from the upper left corner of the view; for an item outside the view, a point on the line towards it. */
  x: number;
  y: number;
  inView: boolean;
}

const at = new Vector3();

/** Return the position of an item in the view; null if it is not shown. */
export function bearingOf(engine: Engine, id: string): Bearing | null {
  const { things, width, height } = engine.shown();
  const thing = things.get(id);
  if (!thing || thing.item.faint >= 1) return null;
  return bearing(thing.anchor(new Vector3()), engine.view.camera, width, height);
}

/** Move the view to an item without changing its direction or its distance to the target. */
export function lookAt(engine: Engine, id: string): void {
  const thing = engine.shown().things.get(id);
  if (!thing) return;
  if (engine.view.mode === "fly") return engine.focus(id);
  const { position, target } = engine.view.viewpoint;
  const to = thing.anchor(new Vector3());
  const moved = to
    .clone()
    .sub(new Vector3(...target))
    .add(new Vector3(...position));
  engine.view.set(moved.toArray(), to.toArray());
}

export function bearing(place: Vector3, camera: PerspectiveCamera, width: number, height: number): Bearing {
  camera.updateMatrixWorld();
  at.copy(place).applyMatrix4(camera.matrixWorldInverse);
  const behind = at.z > -camera.near;
  // A projection behind the camera is mirrored: use the direction on the camera plane.
  let [x, y] = [at.x, at.y];
  if (!behind) {
    at.applyMatrix4(camera.projectionMatrix);
    [x, y] = [at.x, at.y];
  } else {
    const length = Math.hypot(x, y);
    // Exactly behind the camera: left and right are equivalent.
    [x, y] = length < 1e-6 ? [4, 0] : [(4 * x) / length, (4 * y) / length];
  }
  const inView = !behind && Math.abs(x) <= 1 && Math.abs(y) <= 1;
  return { x: ((x + 1) / 2) * width, y: ((1 - y) / 2) * height, inView };
}
