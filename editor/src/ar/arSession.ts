/** A running AR view: pictures of the camera go to the worker, and are shown with the pose that was found in them. */

import type { Engine } from "../engine/engine";
import type { Ar } from "../store/ui";
import { Backdrop, pictureFromView, pictureSize } from "./backdrop";
import { type Mat3, mean, norm, type Point, sub, type Vec3 } from "./geometry";
import { Gyro, turnedView } from "./gyro";
import { type FocalLength, KNOWN, lensOf } from "./lens";
import type { ArMode, Shown } from "./mode";
import type { Bitmap, FromWorker, Start } from "./pictureWorker";
import type { Layout } from "./places";
import {
  combined,
  type Direction,
  dragged,
  type Movement,
  movedPoint,
  movedView,
  type Placement,
  stepTowards,
  tilted,
  UNMOVED,
  viewFrom,
  viewpointOf,
} from "./placing";
import type { View } from "./pose";
import { JUMP, jumpBetween } from "./registration";
import { CameraReporter } from "./sharing";
import { ArProblem, obstacleOfError } from "./support";
import type { Found } from "./tracker";

/** Time for which the last view is shown without markers, ms: turned by the orientation sensor, and without it. */
const BRIDGE = 1500;
const BLINK = 300;
/** Time between two reports of the state, ms, unless its phase changes. */
const REPORT = 250;
/** Time for which a correction is reported, ms. */
const CORRECTION = 4000;
/** The fraction by which the items are hidden, by phase. Before the first registration, their pose is unknown. */
const VEILS: Readonly<Record<Ar["phase"], number>> = {
  starting: 1,
  looking: 1,
  registered: 0,
  bridging: 0.2,
  tracked: 0,
  lost: 0.65,
  hand: 0,
};
const WANTED: MediaTrackConstraints = {
  facingMode: { ideal: "environment" },
  width: { ideal: 1280 },
  height: { ideal: 720 },
  frameRate: { ideal: 30 },
};

export interface CameraOptions {
  engine: Engine;
  layout: Layout;
  /** The known focal length of a camera by its name; null if it is not known. */
  stored: (camera: string) => FocalLength | null;
  store: (camera: string, focal: FocalLength | null) => void;
  /** Return the placement made by hand with a camera. */
  placement: (camera: string) => Placement;
  storePlacement: (camera: string, placement: Placement) => void;
  report: (state: Partial<Ar>) => void;
  /** Called when the camera stops unexpectedly. */
  ended: () => void;
}

/** Open the camera at the back. Reject with ArProblem. Call it in the handler of a tap, as browsers require. */
export async function openCamera(): Promise<MediaStream> {
  try {
    return await navigator.mediaDevices.getUserMedia({ audio: false, video: WANTED });
  } catch (error) {
    throw new ArProblem(obstacleOfError(error));
  }
}

export function releaseCamera(stream: MediaStream): void {
  for (const track of stream.getTracks()) track.stop();
}

export class ArSession implements ArMode {
  readonly mode = "camera";

  get places(): Layout["places"] {
    return this.options.layout.places;
  }

  shown: Shown | null = null;
  onPicture: () => void = () => {};

  private readonly video = document.createElement("video");
  /** The picture that is drawn, and the one that the worker reads. */
  private readonly canvas = document.createElement("canvas");
  private readonly context = this.canvas.getContext("2d", { alpha: false });
  private readonly waiting = document.createElement("canvas");
  private readonly waitingContext = this.waiting.getContext("2d", { alpha: false });
  private readonly gyro = new Gyro();
  private backdrop: Backdrop | null = null;
  private worker: Worker | null = null;
  private ended = false;
  private frozen = false;
  private busy = false;
  private taken = 0;
  /** Orientation of the camera in the waiting picture, and in the last one with markers. */
  private orientation: Mat3 | null = null;
  private anchor: { view: View; orientation: Mat3 | null; at: number } | null = null;
  /** Orientation of the camera in the shown picture. */
  private shownOrientation: Mat3 | null = null;
  /** Whether the anchor was placed by hand. */
  private byHand = false;
  /** Whether to place by hand as soon as there is a picture. */
  private placeLater = false;
  /** Correction of the views from markers by the user. */
  private nudge: Movement;
  private readonly sharing: CameraReporter;
  private phase: Ar["phase"] = "looking";
  private reportedAt = 0;
  private correction = { size: 0, at: 0 };
  private readonly camera: string;
  private readonly middles: Vec3[];

  constructor(
    private readonly stream: MediaStream,
    private readonly options: CameraOptions,
  ) {
    const [track] = stream.getVideoTracks();
    const { width = 0, height = 0 } = track?.getSettings() ?? {};
    this.camera = `${track?.label} ${Math.max(width, height)} × ${Math.min(width, height)}`;
    this.middles = [...options.layout.places.values()].map(({ corners }) => mean(corners));
    this.nudge = options.placement(this.camera).nudge ?? UNMOVED;
    this.sharing = new CameraReporter((camera) => options.report({ camera }));
    if (track) track.onended = () => this.ended || options.ended();
    this.video.muted = true;
    this.video.playsInline = true;
    this.video.srcObject = stream;
  }

  async start(): Promise<void> {
    await this.video.play();
    if (this.ended) return;
    this.beginWorker(this.options.stored(this.camera));
    this.next();
  }

  stop(stay = false): void {
    this.ended = true;
    releaseCamera(this.stream);
    this.video.srcObject = null;
    this.worker?.terminate();
    this.gyro.stop();
    this.backdrop?.dispose();
    this.options.engine.view.release(stay);
  }

  freeze(on: boolean): void {
    this.frozen = on;
    this.options.report({ frozen: on });
    if (!on) this.next();
  }

  /** Forget the focal length and the last pose. */
  recalibrate(): void {
    this.options.store(this.camera, null);
    this.worker?.terminate();
    this.anchor = null;
    this.byHand = false;
    this.busy = false;
    this.beginWorker(null);
    this.enter("looking", {});
    this.freeze(false);
  }

  placeByHand(): void {
    const { shown, byHand, phase, options } = this;
    this.placeLater = !shown;
    if (!shown || byHand || phase === "registered") return;
    const sight = options.placement(this.camera).sight ?? options.engine.view.viewpoint;
    this.byHand = true;
    this.change(shown.view ?? viewFrom(sight, this.shownOrientation), "hand");
  }

  drag(from: readonly Point[], to: readonly Point[]): void {
    const { shown } = this;
    if (!shown?.view) return;
    const size = this.options.engine.shown();
    const inPicture = (point: Point) => pictureFromView(point, shown.found, size);
    const movement = dragged(from.map(inPicture), to.map(inPicture), shown.view, shown.lens);
    if (movement) this.move(movement);
  }

  step(direction: Direction, size: { distance: number; angle: number }): void {
    if (this.shown?.view) this.move(stepTowards(direction, size, this.shown.view));
  }

  tilt(angle: number): void {
    if (this.byHand && this.shown?.view) this.change(tilted(this.shown.view, angle));
  }

  keepPlacement(): void {
    const { nudge, byHand, shown } = this;
    const sight = byHand && shown?.view ? viewpointOf(shown.view) : this.options.placement(this.camera).sight;
    this.options.storePlacement(this.camera, { ...(sight && { sight }), ...(nudge !== UNMOVED && { nudge }) });
  }

  resetPlacement(): void {
    this.nudge = UNMOVED;
    this.options.storePlacement(this.camera, {});
    this.options.report({ nudge: null });
    if (this.byHand) {
      this.byHand = false;
      this.anchor = null;
      this.enter("looking", {});
      this.freeze(false);
    } else {
      const view = this.predicted(this.shownOrientation);
      if (view) this.change(view);
    }
  }

  onScreen([x, y]: Point): Point {
    const { found } = this.shown ?? {};
    if (!found) return [0, 0];
    const { width, height } = this.options.engine.shown();
    const { scale } = pictureSize(found, { width, height });
    return [(x + 0.5 - found.width / 2) * scale + width / 2, (y + 0.5 - found.height / 2) * scale + height / 2];
  }

  private move(by: Movement): void {
    if (this.phase === "lost") this.placeByHand();
    if (!this.shown?.view) return;
    if (!this.byHand) {
      this.nudge = combined(this.nudge, by);
      this.options.report({ nudge: this.nudgeSize() });
    }
    this.change(movedView(this.shown.view, by));
  }

  /** Show another view, also over a frozen picture. */
  private change(view: View, phase = this.phase): void {
    const { shown } = this;
    if (!shown) return;
    this.shown = { ...shown, view };
    if (this.byHand) this.anchor = { view, orientation: this.shownOrientation, at: performance.now() };
    this.backdrop?.show(view, shown.lens, VEILS[phase]);
    this.enter(phase, {});
    this.onPicture();
  }

  /** Return how far the user moved the overlay at the markers, m, and by which angle, rad; null if not at all. */
  private nudgeSize(): Ar["nudge"] {
    const { nudge, middles } = this;
    if (nudge === UNMOVED || middles.length === 0) return null;
    const middle = mean(middles);
    return { distance: norm(sub(movedPoint(middle, nudge), middle)), angle: nudge.angle };
  }

  private beginWorker(focal: FocalLength | null): void {
    const { codes, places } = this.options.layout;
    const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
    worker.onmessage = ({ data }: MessageEvent<FromWorker>) => this.take(data);
    worker.onerror = () => this.options.ended();
    this.worker = worker;
    this.send({ setup: { codes, places, focal } });
  }

  private send(message: Start | Bitmap, transfer: Transferable[] = []): void {
    this.worker?.postMessage(message, transfer);
  }

  /** Take the next picture as soon as the camera has one. */
  private next(): void {
    if (this.ended || this.frozen || this.busy) return;
    this.busy = true;
    const take = () => void this.capture();
    if ("requestVideoFrameCallback" in this.video) this.video.requestVideoFrameCallback(take);
    else requestAnimationFrame(take);
  }

  private async capture(): Promise<void> {
    const { videoWidth: width, videoHeight: height } = this.video;
    if (this.ended || this.frozen || !width || !height) {
      this.busy = false;
      if (!this.frozen) requestAnimationFrame(() => this.next());
      return;
    }
    this.taken = performance.now();
    this.orientation = this.gyro.camera;
    if (this.waiting.width !== width) this.waiting.width = width;
    if (this.waiting.height !== height) this.waiting.height = height;
    this.waitingContext?.drawImage(this.video, 0, 0);
    try {
      const bitmap = await createImageBitmap(this.waiting);
      this.send({ bitmap }, [bitmap]);
    } catch {
      this.busy = false; // the browser is short of memory
      requestAnimationFrame(() => this.next());
    }
  }

  private take({ found, ms }: FromWorker): void {
    this.busy = false;
    if (this.ended || this.frozen) return;
    this.draw(found, ms);
    this.next();
  }

  private draw(found: Found, ms: number): void {
    const { width, height, registration, focal, checked } = found;
    const now = performance.now();
    const lens = lensOf(focal, width, height);
    const before = this.predicted(this.orientation);
    this.shownOrientation = this.orientation;
    const age = this.anchor ? now - this.anchor.at : Number.POSITIVE_INFINITY;
    let view = before;
    if (registration) {
      view = movedView(registration.view, this.nudge);
      const wasLost = ["bridging", "lost", "hand"].includes(this.phase);
      const jump = before && wasLost ? jumpBetween(before, view, this.middles) : 0;
      if (jump > JUMP) this.correction = { size: jump, at: now };
      this.anchor = { view: registration.view, orientation: this.orientation, at: now };
      this.byHand = false;
      if (focal.deviation <= KNOWN) this.options.store(this.camera, focal);
    }
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.backdrop?.dispose(); // a texture has one size
      this.backdrop = null;
      [this.canvas.width, this.canvas.height] = [width, height];
    }
    this.context?.drawImage(this.waiting, 0, 0);
    this.backdrop ??= new Backdrop(this.options.engine, this.canvas);
    const bridged = age <= (this.anchor?.orientation && this.orientation ? BRIDGE : BLINK);
    const phase = this.byHand
      ? "hand"
      : registration
        ? "registered"
        : !this.anchor
          ? "looking"
          : bridged
            ? "bridging"
            : "lost";
    this.backdrop.show(view, lens, VEILS[phase]);
    const count = (this.shown?.count ?? 0) + 1;
    this.shown = { found, view, lens, latency: now - this.taken, ms, count };
    this.sharing.take(phase === "lost" ? null : view, now);
    this.enter(phase, {
      nudge: this.nudgeSize(),
      sensor: this.orientation !== null,
      checked,
      loss: found.loss ?? "unseen",
      corrected: now - this.correction.at < CORRECTION ? this.correction.size : 0,
      ...(registration && {
        grade: registration.grade,
        error: registration.error,
        used: registration.used,
        contradicting: registration.contradicting,
        undecided: registration.undecided,
        seenAt: Date.now(),
      }),
    });
    if (this.placeLater) this.placeByHand();
    this.onPicture();
  }

  /** Return the view expected without markers: the last one, turned as the device was turned since. */
  private predicted(orientation: Mat3 | null): View | null {
    if (!this.anchor) return null;
    const { orientation: before } = this.anchor;
    const view = this.byHand ? this.anchor.view : movedView(this.anchor.view, this.nudge);
    return before && orientation ? turnedView(view, before, orientation) : view;
  }

  private enter(phase: Ar["phase"], state: Partial<Ar>): void {
    const now = performance.now();
    if (phase === this.phase && now - this.reportedAt < REPORT) return;
    this.phase = phase;
    this.reportedAt = now;
    this.options.report({ ...state, phase });
  }
}
