/** The renderer of three.js for a canvas, as costly as the device can afford. */

import { PCFShadowMap, SRGBColorSpace, WebGLRenderer } from "three";
import type { Quality } from "./surface";

export function rendererOf(canvas: HTMLCanvasElement, quality: Quality): WebGLRenderer {
  // An opaque canvas saves blending with the page.
  const context = canvas.getContext("webgl2", {
    alpha: false,
    antialias: quality !== "low",
    powerPreference: "low-power",
  });
  const renderer = new WebGLRenderer({ canvas, ...(context && { context }) });
  renderer.outputColorSpace = SRGBColorSpace;
  renderer.setPixelRatio(quality === "low" ? 1 : Math.min(2, window.devicePixelRatio));
  renderer.shadowMap.enabled = quality === "high";
  renderer.shadowMap.type = PCFShadowMap;
  renderer.shadowMap.autoUpdate = false;
  return renderer;
}
