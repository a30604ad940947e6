/** A frozen picture behind the items in an XR session. */

import { type CanvasTexture, Matrix4, type Scene } from "three";
import { DEPTH, discard, type Sheet, sheetOf, textureOf } from "./sheet";

const inverse = new Matrix4();
const plane = new Matrix4();

export class FrozenPicture {
  private readonly texture: CanvasTexture;
  private readonly sheet: Sheet;

  constructor(scene: Scene, canvas: HTMLCanvasElement) {
    this.texture = textureOf(canvas);
    this.sheet = sheetOf(scene, this.texture, -1000, 1);
  }

  /** Fill the view of a camera. */
  follow(camera: Matrix4, projection: Matrix4): void {
    plane.makeTranslation(0, 0, DEPTH);
    this.sheet.matrixWorld.multiplyMatrices(camera, inverse.copy(projection).invert()).multiply(plane);
  }

  dispose(): void {
    discard(this.sheet);
    this.texture.dispose();
  }
}
