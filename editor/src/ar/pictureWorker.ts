/** Common part of the AR workers, which analyse pictures and report the markers in them. */

import type { Pixels } from "./cameraPixels";
import type { Lens } from "./pose";
import type { Found, Setup, Tracker } from "./tracker";

/** A picture, or the pixels of one with a known lens. */
export interface Bitmap {
  bitmap: ImageBitmap;
}
export interface WithLens {
  pixels: Pixels;
  lens: Lens;
}
/** The result for a picture, and the duration of the processing, ms. */
export interface FromWorker {
  found: Found;
  ms: number;
}

/** The start. */
export interface Start {
  setup: Setup;
}

/** The part of the worker's scope that is used; the types of the page do not contain it. */
interface Scope<Picture> {
  onmessage: ((event: MessageEvent<Start | Picture>) => void) | null;
  postMessage(message: FromWorker): void;
}

/**
 * Answer the messages of the page. `process` finds the markers in the picture of a message; it returns null if the
 * picture has no pixels.
 */
export function serve<Picture extends object>(
  newTracker: (setup: Setup) => Tracker,
  process: (tracker: Tracker, picture: Picture) => Found | null,
): void {
  const scope = globalThis as unknown as Scope<Picture>;
  let tracker: Tracker | null = null;
  scope.onmessage = ({ data }) => {
    const began = performance.now();
    if ("setup" in data) tracker = newTracker(data.setup);
    else if (tracker) {
      const found = process(tracker, data);
      if (found) scope.postMessage({ found, ms: performance.now() - began });
    }
  };
}
