/** The renderer of three.js for a canvas, as costly as the device can afford. */

import { PCFShadowMap, SRGBColorSpace, WebGLRenderer, WebGLRenderTarget } from "three";
import type { Quality } from "./surface";

export class Renderer extends WebGLRenderer {
  /** Return a target for the framebuffer of an XR session. */
  xrTarget(width: number, height: number): WebGLRenderTarget {
    const target = new WebGLRenderTarget(width, height, { colorSpace: SRGBColorSpace });
    return Object.assign(target, { isXRRenderTarget: true });
  }
}

export function rendererOf(canvas: HTMLCanvasElement, quality: Quality): Renderer {
  // An opaque canvas saves blending with the page.
  const context = canvas.getContext("webgl2", {
    alpha: false,
    antialias: quality !== "low",
    powerPreference: "low-power",
  });
  const renderer = new Renderer({ canvas, ...(context && { context }) });
  renderer.outputColorSpace = SRGBColorSpace;
  renderer.setPixelRatio(quality === "low" ? 1 : Math.min(2, window.devicePixelRatio));
  renderer.shadowMap.enabled = quality === "high";
  renderer.shadowMap.type = PCFShadowMap;
  renderer.shadowMap.autoUpdate = false;
  return renderer;
}
