/** The worker of AR: reads pictures and reports what they show. */

import { greyOf } from "./grey";
import { type Found, type Setup, Tracker } from "./tracker";

/** The start, or a picture. */
export type ToWorker = { setup: Setup } | { bitmap: ImageBitmap };
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
