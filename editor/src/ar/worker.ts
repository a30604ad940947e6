/** The worker of AR: reads pictures and reports what they show. */

import type { Pixels } from "./cameraPixels";
import { flipped, greyOf } from "./grey";
import type { Lens } from "./pose";
import { type Found, type Setup, Tracker } from "./tracker";

/** The start, a picture, or the pixels of one with a known lens. */
export type ToWorker = { setup: Setup } | { bitmap: ImageBitmap } | { pixels: Pixels; lens: Lens };
/** What a picture shows, and the time that it took, ms. */
export interface FromWorker {
  found: Found;
  ms: number;
}

/** The part of the worker's scope that is used; the types of the page do not contain it. */
interface Scope {
  onmessage: ((event: MessageEvent<ToWorker>) => void) | null;
  postMessage(message: FromWorker): void;
}

function serve(scope: Scope): void {
  let tracker: Tracker | null = null;
  let canvas = new OffscreenCanvas(1, 1);
  let context = canvas.getContext("2d", { willReadFrequently: true });
  scope.onmessage = ({ data }) => {
    if ("setup" in data) {
      tracker = new Tracker(data.setup);
      return;
    }
    const began = performance.now();
    if ("pixels" in data) {
      if (!tracker) return;
      const { width, height } = data.pixels;
      const grey = flipped(greyOf(data.pixels.data, width, height));
      scope.postMessage({ found: tracker.look(grey, data.lens), ms: performance.now() - began });
      return;
    }
    const { width, height } = data.bitmap;
    if (canvas.width !== width || canvas.height !== height) {
      canvas = new OffscreenCanvas(width, height);
      context = canvas.getContext("2d", { willReadFrequently: true });
    }
    context?.drawImage(data.bitmap, 0, 0);
    data.bitmap.close();
    const pixels = context?.getImageData(0, 0, width, height).data;
    if (!tracker || !pixels) return;
    const found = tracker.look(greyOf(pixels, width, height));
    scope.postMessage({ found, ms: performance.now() - began });
  };
}

serve(globalThis as unknown as Scope);
