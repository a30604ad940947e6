/** The worker for pictures of WebXR, which states their lens. */

import { flipped, greyOf } from "./grey";
import { serve, type WithLens } from "./pictureWorker";
import { Tracker } from "./tracker";

serve(
  (setup) => new Tracker(setup),
  (tracker, { pixels, lens }: WithLens) =>
    tracker.process(flipped(greyOf(pixels.data, pixels.width, pixels.height)), lens),
);
