/** Frames of WebXR (y up) and of the workplace (z up), the pictures of its eyes, and how they are drawn. */

import {
  type Camera,
  CustomBlending,
  DoubleSide,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  type PerspectiveCamera,
  PlaneGeometry,
  type Scene,
  SrcAlphaFactor,
  type WebGLRenderTarget,
  ZeroFactor,
} from "three";
import type { Renderer } from "../engine/renderer";
import type { Mat3, Vec3 } from "./geometry";
import type { Lens, View } from "./pose";

/** From the camera frame of WebXR (x right, y up, z backward) to that of a picture (x right, y down, z forward). */
const FLIP = new Matrix4().makeScale(1, -1, -1);

export const matrixOf = (elements: ArrayLike<number>): Matrix4 => new Matrix4().fromArray(elements);
export const inverseOf = (matrix: Matrix4): Matrix4 => matrix.clone().invert();

/** Return the view of a camera. Both poses are in the frame of WebXR. */
export function viewOf(workplace: Matrix4, camera: Matrix4): View {
  const e = inverseOf(camera.clone().multiply(FLIP)).multiply(workplace).elements;
  const row = (n: number): Vec3 => [e[n] as number, e[4 + n] as number, e[8 + n] as number];
  const turn: Mat3 = [row(0), row(1), row(2)];
  return { turn, shift: [e[12] as number, e[13] as number, e[14] as number] };
}

/** Return the pose of the workplace in the frame of WebXR for a view of a camera. */
export function workplaceIn({ turn, shift }: View, camera: Matrix4): Matrix4 {
  const [a, b, c] = turn;
  const cameraFromWorkplace = new Matrix4().set(...a, shift[0], ...b, shift[1], ...c, shift[2], 0, 0, 0, 1);
  return camera.clone().multiply(FLIP).multiply(cameraFromWorkplace);
}

/** Return the lens of a picture that has the projection of its view. */
export function lensIn(projection: ArrayLike<number>, width: number, height: number): Lens {
  const [across = 1, down = 1] = [projection[0], projection[5]];
  return {
    focal: (across * width + down * height) / 4,
    cx: ((1 - (projection[8] ?? 0)) * width) / 2 - 0.5,
    cy: ((1 + (projection[9] ?? 0)) * height) / 2 - 0.5,
  };
}

/** A rectangle on the screen, pixels. */
export interface Rect {
  left: number;
  top: number;
  width: number;
  height: number;
}

/** Return the projection of a part of the screen. */
export function cropped(projection: Matrix4, screen: { width: number; height: number }, part: Rect): Matrix4 {
  const [x, y] = [screen.width / part.width, screen.height / part.height];
  const right = x - 1 - (2 * part.left) / part.width;
  const up = 1 - y + (2 * part.top) / part.height;
  return new Matrix4().set(x, 0, 0, right, 0, y, 0, up, 0, 0, 1, 0, 0, 0, 0, 1).multiply(projection);
}

/** An eye: its pose in the frame of WebXR, and its projection. */
export interface Eye {
  pose: Matrix4;
  projection: Matrix4;
}

/** Draws into the framebuffer of an XR session. */
export class XrOutput {
  private target: WebGLRenderTarget | null = null;
  /** Dims the picture behind it. */
  private readonly veil = new Mesh(
    new PlaneGeometry(2, 2),
    new MeshBasicMaterial({
      side: DoubleSide,
      depthTest: false,
      depthWrite: false,
      transparent: true,
      blending: CustomBlending,
      blendSrc: ZeroFactor,
      blendDst: SrcAlphaFactor,
      blendSrcAlpha: ZeroFactor,
      blendDstAlpha: SrcAlphaFactor,
    }),
  );

  constructor(
    private readonly renderer: Renderer,
    private readonly camera: PerspectiveCamera,
    /** The objects that are drawn after the items, in the frame of WebXR. */
    private readonly local: Scene,
  ) {
    this.camera.matrixAutoUpdate = this.camera.matrixWorldAutoUpdate = false;
    this.veil.frustumCulled = false;
    this.veil.matrixAutoUpdate = this.veil.matrixWorldAutoUpdate = false;
    this.veil.renderOrder = -1;
    local.add(this.veil);
  }

  /** Draw the items for each eye. `workplace`: null hides the items. `veil`: how much of them is hidden. */
  draw(
    items: Scene,
    workplace: Matrix4 | null,
    layer: XRWebGLLayer,
    eyes: readonly (Eye & { viewport: XRViewport })[],
    veil: number,
  ): void {
    const { renderer } = this;
    this.target ??= renderer.xrTarget(layer.framebufferWidth, layer.framebufferHeight);
    // Types of three.js do not contain it.
    const bound = renderer as Renderer & { setRenderTargetFramebuffer(to: WebGLRenderTarget, by: unknown): void };
    bound.setRenderTargetFramebuffer(this.target, layer.framebuffer);
    this.veil.visible = veil > 0 && workplace !== null;
    this.veil.material.opacity = 1 - veil;
    renderer.autoClear = false;
    eyes.forEach(({ pose, projection, viewport }, number) => {
      const { x, y, width, height } = viewport;
      this.target?.viewport.set(x, y, width, height);
      renderer.setRenderTarget(this.target);
      if (number === 0) renderer.clear();
      if (workplace) renderer.render(items, this.looking(inverseOf(workplace).multiply(pose), projection));
      const camera = this.looking(pose, projection);
      this.veil.matrixWorld.multiplyMatrices(pose, camera.projectionMatrixInverse);
      renderer.render(this.local, camera);
    });
    renderer.autoClear = true;
    renderer.setRenderTarget(null);
  }

  dispose(): void {
    this.target?.dispose();
    this.veil.geometry.dispose();
    this.veil.material.dispose();
  }

  private looking(pose: Matrix4, projection: Matrix4): Camera {
    const { camera } = this;
    camera.matrixWorld.copy(pose);
    camera.matrixWorldInverse.copy(pose).invert();
    camera.projectionMatrix.copy(projection);
    camera.projectionMatrixInverse.copy(projection).invert();
    return camera;
  }
}
