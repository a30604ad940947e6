/** A rectangle in the view that shows a picture. */

import { CanvasTexture, DoubleSide, Mesh, MeshBasicMaterial, PlaneGeometry, type Scene, SRGBColorSpace } from "three";

/** Depth of a picture in the view: behind everything. */
export const DEPTH = 0.999;

export type Sheet = Mesh<PlaneGeometry, MeshBasicMaterial>;

/** Return the texture of a picture that may change. */
export function textureOf(canvas: HTMLCanvasElement): CanvasTexture {
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.generateMipmaps = false;
  return texture;
}

export function sheetOf(scene: Scene, map: CanvasTexture, order: number, opacity: number): Sheet {
  const material = new MeshBasicMaterial({
    map,
    side: DoubleSide, // the projection mirrors it
    depthTest: false,
    depthWrite: false,
    fog: false,
    toneMapped: false,
    transparent: opacity < 1,
    opacity,
  });
  const sheet = new Mesh(new PlaneGeometry(2, 2), material);
  sheet.renderOrder = order;
  sheet.frustumCulled = false;
  sheet.matrixAutoUpdate = sheet.matrixWorldAutoUpdate = false;
  sheet.raycast = () => {};
  sheet.userData.ground = true; // nothing to select
  scene.add(sheet);
  return sheet;
}

export function discard(sheet: Sheet): void {
  sheet.removeFromParent();
  sheet.geometry.dispose();
  sheet.material.dispose();
}
