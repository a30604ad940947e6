/** The picture of the camera behind the items of the 3D view, and in front of them as a veil that dims them. */

import { type CanvasTexture, Matrix4, type Object3D } from "three";
import type { Engine } from "../engine/engine";
import type { Point } from "./geometry";
import { eyeOf, type Lens, type View } from "./pose";
import { DEPTH, discard, type Sheet, sheetOf, textureOf } from "./sheet";

const inverse = new Matrix4();
const plane = new Matrix4();
const pose = new Matrix4();

/** The size of a picture in a view that it fills: scale, and pixels of the view. */
interface PictureSize {
  scale: number;
  width: number;
  height: number;
}

/** Return the size at which a picture fills a view; what exceeds the view is cut off at both sides. */
export function pictureSize(
  picture: { width: number; height: number },
  view: { width: number; height: number },
): PictureSize {
  const scale = Math.max(view.width / picture.width, view.height / picture.height);
  return { scale, width: picture.width * scale, height: picture.height * scale };
}

/** Return the point of a picture, pixels, for a point of the view that the picture fills. */
export function pictureFromView(
  [x, y]: Point,
  picture: { width: number; height: number },
  view: { width: number; height: number },
): Point {
  const { scale } = pictureSize(picture, view);
  return [
    (x - view.width / 2) / scale + picture.width / 2 - 0.5,
    (y - view.height / 2) / scale + picture.height / 2 - 0.5,
  ];
}

export class Backdrop {
  private readonly texture: CanvasTexture;
  private readonly picture: Sheet;
  private readonly veil: Sheet;
  private readonly hidden: Object3D[];
  private readonly fog;

  constructor(
    private readonly engine: Engine,
    private readonly canvas: HTMLCanvasElement,
  ) {
    this.texture = textureOf(canvas);
    this.hidden = engine.scene.children.filter((each) => each.userData.ground && each.visible);
    for (const each of this.hidden) each.visible = false;
    this.fog = engine.scene.fog;
    engine.scene.fog = null;
    this.picture = this.sheet(-1000, 1);
    this.veil = this.sheet(1000, 0);
  }

  /** Show the picture of the canvas with the items as seen from a view. `veil`: how much of the items is hidden. */
  show(view: View | null, lens: Lens, veil: number): void {
    const { width, height } = this.engine.shown();
    const { scale, ...size } = pictureSize(this.canvas, { width, height });
    const fov = (2 * Math.atan(height / (2 * scale * lens.focal)) * 180) / Math.PI;
    if (view) this.engine.view.follow(poseOf(view), fov);
    const { camera } = this.engine.view;
    camera.updateMatrixWorld();
    inverse.copy(camera.projectionMatrix).invert();
    plane.makeScale(size.width / width, size.height / height, 1).setPosition(0, 0, DEPTH);
    for (const sheet of [this.picture, this.veil]) {
      sheet.matrixWorld.multiplyMatrices(camera.matrixWorld, inverse).multiply(plane);
    }
    this.veil.visible = veil > 0;
    this.veil.material.opacity = veil;
    this.texture.needsUpdate = true;
    this.engine.invalidate();
  }

  dispose(): void {
    for (const sheet of [this.picture, this.veil]) discard(sheet);
    this.texture.dispose();
    for (const each of this.hidden) each.visible = true;
    this.engine.scene.fog ??= this.fog;
    this.engine.invalidate();
  }

  private sheet(order: number, opacity: number): Sheet {
    return sheetOf(this.engine.scene, this.texture, order, opacity);
  }
}

/** Return the pose of a camera of three.js (x right, y up, z backward) in the workplace. */
function poseOf(view: View): Matrix4 {
  const [x, y, z] = view.turn;
  const [ex, ey, ez] = eyeOf(view);
  return pose.set(x[0], -y[0], -z[0], ex, x[1], -y[1], -z[1], ey, x[2], -y[2], -z[2], ez, 0, 0, 0, 1);
}
