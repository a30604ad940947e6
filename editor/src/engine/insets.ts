/** Small views of the surroundings of an item from above and from a side, drawn into the frame of the 3D view. */

import { type Object3D, Vector2, Vector3 } from "three";
import type { ViewName } from "./camera";
import type { Engine } from "./engine";
import type { Rect } from "./labels";
import { boundsOf } from "./thing";

export type Side = Exclude<ViewName, "home">;

/** Directions from the middle to the camera, and upwards on the screen. */
const DIRECTIONS: Record<Side, [Vector3, Vector3]> = {
  top: [new Vector3(0, 0, 1), new Vector3(0, 1, 0)],
  front: [new Vector3(0, -1, 0), new Vector3(0, 0, 1)],
  back: [new Vector3(0, 1, 0), new Vector3(0, 0, 1)],
  side: [new Vector3(1, 0, 0), new Vector3(0, 0, 1)],
  left: [new Vector3(-1, 0, 0), new Vector3(0, 0, 1)],
};
/** Distance of the camera, m: so far away that the picture has hardly any perspective. */
const AWAY = 20;
/** Depth around the middle of the view that is drawn, in both directions, m. */
const DEPTH = 5;
/** Margin around an item, m, and relative to its size. */
const AROUND = 0.12;
const PART = 0.75;

/** Part of the workplace in a view: its middle, and half of its height, m. */
interface Region {
  middle: Vector3;
  half: number;
}

/** The side nearest to the direction from which the camera looks. */
export function nearestSide(position: Vector3, target: Vector3): Side {
  const [x, y] = [position.x - target.x, position.y - target.y];
  if (Math.abs(x) > Math.abs(y)) return x > 0 ? "side" : "left";
  return y > 0 ? "back" : "front";
}

/** The surroundings of an item; without one, those of the point at which the camera looks. */
export function regionOf(engine: Engine, id: string): Region {
  const thing = engine.shown().things.get(id);
  if (!thing) return { middle: engine.view.target.clone(), half: 0.5 };
  const box = boundsOf(thing);
  const size = box.getSize(new Vector3());
  return { middle: box.getCenter(new Vector3()), half: AROUND + PART * Math.max(size.x, size.y, size.z) };
}

/** Draw the region from a side over a part of the frame, pixels. */
export function drawInset(
  { renderer, scene, view: { camera: large } }: Engine,
  side: Side,
  region: Region,
  box: Rect,
  view: DOMRect,
): void {
  const [back, up] = DIRECTIONS[side];
  const { middle, half } = region;
  const camera = large.clone();
  camera.fov = (2 * Math.atan(half / AWAY) * 180) / Math.PI;
  camera.aspect = (box.right - box.left) / (box.bottom - box.top);
  camera.near = AWAY - DEPTH;
  camera.far = AWAY + DEPTH;
  camera.up.copy(up);
  camera.position.copy(middle).addScaledVector(back, AWAY);
  camera.lookAt(middle);
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld();
  const size = renderer.getSize(new Vector2());
  const scale = size.x / view.width;
  const place = [box.left, view.height - box.bottom, box.right - box.left, box.bottom - box.top].map(
    (each) => each * scale,
  ) as [number, number, number, number];
  const { fog } = scene;
  const hidden = hide(scene);
  scene.fog = null;
  renderer.setScissorTest(true);
  renderer.setViewport(...place);
  renderer.setScissor(...place);
  renderer.render(scene, camera);
  renderer.setScissorTest(false);
  renderer.setViewport(0, 0, size.x, size.y);
  scene.fog = fog;
  for (const each of hidden) each.visible = true;
}

/** Hide items of constant size on the screen, such as handles, since insets have another scale. Return them. */
function hide(scene: Object3D): Object3D[] {
  const found = scene.children.filter((each) => each.visible && each.userData.handles);
  for (const each of found) each.visible = false;
  return found;
}
