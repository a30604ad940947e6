/** Pictures of the camera of an XR session, and the markers in them. */

import { Matrix4 } from "three";
import { CameraPixels, canvasOf } from "./cameraPixels";
import type { FromWorker, Start, WithLens } from "./pictureWorker";
import type { Layout } from "./places";
import type { Lens } from "./pose";
import type { Found } from "./tracker";
import { type Eye, lensIn } from "./xrView";

/** Time between two pictures, ms. Each of them costs the device a copy. */
const PERIOD = 150;

/** The time and the camera poses of a picture. */
export interface PictureOrigin {
  eyes: readonly (Eye & { viewport: XRViewport })[];
  camera: Matrix4;
  lens: Lens;
  at: number;
}

interface Handlers {
  found: (found: Found, ms: number, taken: PictureOrigin) => void;
  /** Called with the picture that `captureNext` requested. */
  captured: (picture: HTMLCanvasElement, taken: PictureOrigin) => void;
  failed: () => void;
}

/** The parts of WebXR for pictures of the camera, which the types do not contain. */
type CameraView = XRView & { camera?: { width: number; height: number } };
interface CameraBinding {
  getCameraImage(camera: unknown): WebGLTexture;
}

export class XrPictures {
  private readonly pixels: CameraPixels;
  private readonly binding: CameraBinding;
  private readonly worker: Worker;
  private taken: PictureOrigin | null = null;
  private busy = false;
  private readAt = 0;
  private captureRequested = false;

  constructor(
    session: XRSession,
    gl: WebGL2RenderingContext,
    { codes, places }: Layout,
    private readonly handlers: Handlers,
  ) {
    this.pixels = new CameraPixels(gl);
    this.binding = new XRWebGLBinding(session, gl) as unknown as CameraBinding;
    this.worker = new Worker(new URL("./xrWorker.ts", import.meta.url), { type: "module" });
    this.worker.onmessage = ({ data: { found, ms } }: MessageEvent<FromWorker>) => {
      this.busy = false;
      if (this.taken) handlers.found(found, ms, this.taken);
    };
    this.worker.onerror = () => handlers.failed();
    this.send({ setup: { codes, places, focal: null } });
  }

  /** Pass the next picture to `captured`. */
  captureNext(): void {
    this.captureRequested = true;
  }

  /** Pass the picture that was read to the worker, and read the one of this frame when it is due. */
  process(view: XRView, eyes: PictureOrigin["eyes"]): void {
    const { camera } = view as CameraView;
    const now = performance.now();
    const pixels = this.busy ? null : this.pixels.take();
    if (pixels && this.taken) {
      if (this.captureRequested) this.handlers.captured(canvasOf(pixels), this.taken);
      this.captureRequested = false;
      this.busy = true;
      this.send({ pixels, lens: this.taken.lens }, [pixels.data.buffer]);
    }
    if (!camera || this.busy || now - this.readAt < PERIOD) return;
    const { width, height } = camera;
    if (!this.pixels.read(this.binding.getCameraImage(camera), width, height)) return;
    this.readAt = now;
    const pose = new Matrix4().fromArray(view.transform.matrix);
    this.taken = { eyes, camera: pose, lens: lensIn(view.projectionMatrix, width, height), at: now };
  }

  dispose(): void {
    this.worker.terminate();
    this.pixels.dispose();
  }

  private send(message: Start | WithLens, transfer: Transferable[] = []): void {
    this.worker.postMessage(message, transfer);
  }
}
