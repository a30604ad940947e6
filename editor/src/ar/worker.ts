/** The worker for pictures of a camera whose focal length is not known. */

import { type Grey, greyOf } from "./grey";
import { LensLearner } from "./lens";
import { type Bitmap, serve } from "./pictureWorker";
import { Tracker } from "./tracker";

/** Return a function that reads pictures. */
function reader(): (bitmap: ImageBitmap) => Grey | null {
  let canvas = new OffscreenCanvas(1, 1);
  let context = canvas.getContext("2d", { willReadFrequently: true });
  return (bitmap) => {
    const { width, height } = bitmap;
    if (canvas.width !== width || canvas.height !== height) {
      canvas = new OffscreenCanvas(width, height);
      context = canvas.getContext("2d", { willReadFrequently: true });
    }
    context?.drawImage(bitmap, 0, 0);
    bitmap.close();
    const pixels = context?.getImageData(0, 0, width, height).data;
    return pixels ? greyOf(pixels, width, height) : null;
  };
}

const read = reader();

serve(
  (setup) => new Tracker(setup, new LensLearner(setup.places)),
  (tracker, { bitmap }: Bitmap) => {
    const picture = read(bitmap);
    return picture && tracker.process(picture);
  },
);
