/**
 * AR with WebXR on Android tablets and headsets: the device tracks itself. Markers, touched points or a surface
 * register the workplace. Tracking may drift without notice, so markers win over anchors.
 */

import { Scene } from "three";
import type { Ar } from "../store/ui";
import { FrozenPicture } from "./frozenPicture";
import { mean, norm, type Point, sub, type Vec3 } from "./geometry";
import type { Headset, HeadsetHost } from "./headset";
import type { ArMode, Shown } from "./mode";
import type { Layout } from "./places";
import {
  combined,
  type Direction,
  dragged,
  type Movement,
  movedPoint,
  movedView,
  stepTowards,
  UNMOVED,
} from "./placing";
import { CameraReporter } from "./sharing";
import type { TouchFit } from "./touch";
import type { Found } from "./tracker";
import { type PictureOrigin, XrPictures } from "./xrPictures";
import { cropped, inverseOf, lensIn, matrixOf, viewOf, workplaceIn, XrOutput } from "./xrView";
import { XrWorkplace } from "./xrWorkplace";

/** Time between two reports, and for which a correction is reported, ms. */
const REPORT = 250;
const CORRECTION = 4000;
/** Time after which markers count as out of sight, ms. */
const FRESH = 1000;
/** Part of the items that is hidden while tracking is lost. */
const LOST = 0.65;
/** Distances between which items are drawn, m. */
const NEAR = 0.05;
const FAR = 100;

interface Options extends Omit<HeadsetHost, "workplace"> {
  report: (state: Partial<Ar>) => void;
  /** Called when the session ends unexpectedly. */
  ended: () => void;
}

/** Start an XR session with the page over it. Call it in the handler of a tap, as browsers require. */
export function requestXr(): Promise<XRSession> {
  return (navigator.xr as XRSystem).requestSession("immersive-ar", {
    optionalFeatures: ["hit-test", "anchors", "dom-overlay", "camera-access", "hand-tracking"],
    domOverlay: { root: document.body }, // dialogs and menus are children of the body, too
  });
}

/** Return whether the page is shown over the session; without it, the controls are in space. */
export const hasOverlay = (session: XRSession): boolean => Boolean(session.domOverlayState);

const suppress = (event: Event) => event.preventDefault();

export class XrArSession implements ArMode {
  readonly mode: "tablet" | "headset";
  shown: Shown | null = null;
  onPicture: () => void = () => {};
  readonly workplace: XrWorkplace;
  /** Controls in space, without the page over the session. */
  headset: Headset | null = null;

  private readonly local = new Scene();
  private readonly output: XrOutput;
  private readonly sharing: CameraReporter;
  private readonly middles: readonly Vec3[];
  private space: XRReferenceSpace | null = null;
  private hits: XRHitTestSource | null = null;
  private pictures: XrPictures | null = null;
  private layer: XRWebGLLayer | null = null;
  private ended = false;
  private lastFrame = 0;
  private nudge: Movement = UNMOVED;
  private eyes: PictureOrigin["eyes"] = [];
  private viewer = matrixOf([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
  private placesNext = false;
  private frozen: FrozenPicture | null = null;
  private correction = { size: 0, at: 0 };
  private phase: Ar["phase"] = "looking";
  private reportedAt = 0;
  private readonly before;

  constructor(
    private readonly session: XRSession,
    private readonly options: Options,
  ) {
    const { engine, layout } = options;
    const { scene, renderer } = engine;
    this.mode = hasOverlay(session) ? "tablet" : "headset";
    this.output = new XrOutput(renderer, engine.view.camera.clone(), this.local);
    this.sharing = new CameraReporter((camera) => options.report({ camera }));
    this.middles = [...layout.places.values()].map(({ corners }) => mean(corners));
    this.workplace = new XrWorkplace(this.middles);
    this.before = {
      output: engine.output,
      background: scene.background,
      fog: scene.fog,
      alpha: renderer.getClearAlpha(),
      ground: scene.children.filter((each) => each.userData.ground && each.visible),
    };
  }

  get places(): Layout["places"] {
    return this.options.layout.places;
  }

  async start(): Promise<void> {
    const { session, options } = this;
    const { engine } = options;
    const gl = engine.renderer.getContext() as WebGL2RenderingContext;
    session.addEventListener("end", () => this.ended || options.ended());
    session.addEventListener("visibilitychange", () => session.visibilityState === "visible" || this.hide());
    await gl.makeXRCompatible();
    this.layer = new XRWebGLLayer(session, gl);
    await session.updateRenderState({ baseLayer: this.layer, depthNear: NEAR, depthFar: FAR });
    this.space = await session.requestReferenceSpace("local");
    this.space.addEventListener("reset", () => this.workplace.reset() && options.release());
    const viewer = await session.requestReferenceSpace("viewer");
    this.hits = (await session.requestHitTestSource?.({ space: viewer })?.catch(() => null)) ?? null;
    const headset = this.mode === "headset" ? await import("./headset") : null;
    if (this.ended) return;
    if (headset) {
      const host = { ...options, workplace: () => this.workplace.pose };
      this.headset = new headset.Headset(session, this.local, host);
    }
    const pictures = session.enabledFeatures?.includes("camera-access") ?? false;
    if (pictures) {
      this.pictures = new XrPictures(session, gl, options.layout, {
        found: (found, ms, taken) => this.take(found, ms, taken),
        captured: (picture, taken) => this.showFrozen(picture, taken),
        failed: options.ended,
      });
    }
    document.body.classList.add("xr");
    // Taps on the page are taps on its controls, and on the 3D view as always.
    document.body.addEventListener("beforexrselect", suppress);
    for (const each of this.before.ground) each.visible = false;
    engine.renderer.setClearAlpha(0);
    engine.requests.driven = true;
    engine.output = (scene) => this.draw(scene);
    options.report({ pictures });
    session.requestAnimationFrame((time, frame) => this.frame(time, frame));
  }

  stop(stay = false): void {
    if (this.ended) return;
    this.ended = true;
    const { engine } = this.options;
    this.pictures?.dispose();
    this.hits?.cancel();
    this.frozen?.dispose();
    this.headset?.dispose();
    this.workplace.forget();
    this.output.dispose();
    document.body.classList.remove("xr");
    document.body.removeEventListener("beforexrselect", suppress);
    const { output, background, fog, alpha, ground } = this.before;
    engine.output = output;
    engine.scene.background ??= background;
    engine.scene.fog ??= fog;
    engine.renderer.setClearAlpha(alpha);
    for (const each of ground) each.visible = true;
    engine.requests.driven = false;
    engine.view.release(stay);
    engine.invalidate();
    this.session.end().catch(() => {}); // it has ended
  }

  freeze(on: boolean): void {
    if (on) this.pictures?.captureNext();
    else this.thaw();
  }

  recalibrate(): void {
    this.thaw();
    this.workplace.forget();
  }

  placeByHand(): void {
    const { source, at } = this.workplace;
    // Without the buttons of a tablet, a surface is chosen again by looking at it.
    const again = source !== "hand" || this.headset !== null;
    this.placesNext = again && !(source === "markers" && performance.now() - at < FRESH);
  }

  drag(from: readonly Point[], to: readonly Point[]): void {
    const { pose } = this.workplace;
    const projection = this.eyes[0]?.projection.elements;
    if (!pose || !projection) return;
    const { left, top } = this.options.engine.view.element.getBoundingClientRect();
    const lens = lensIn(projection, window.innerWidth, window.innerHeight);
    const onScreen = (points: readonly Point[]) => points.map(([x, y]): Point => [x + left - 0.5, y + top - 0.5]);
    const movement = dragged(onScreen(from), onScreen(to), viewOf(pose, this.viewer), lens);
    if (movement) this.move(movement);
  }

  step(direction: Direction, size: { distance: number; angle: number }): void {
    const { pose } = this.workplace;
    if (pose) this.move(stepTowards(direction, size, viewOf(pose, this.viewer)));
  }

  /** The device knows the vertical. */
  tilt(): void {}

  /** The next session has another frame, so nothing is stored. */
  keepPlacement(): void {}

  resetPlacement(): void {
    this.nudge = UNMOVED;
    if (this.workplace.source === "hand") this.workplace.forget();
    this.options.report({ nudge: null });
  }

  onScreen([x, y]: Point): Point {
    const { width = 1, height = 1 } = this.shown?.found ?? {};
    const { left, top } = this.options.engine.view.element.getBoundingClientRect();
    return [((x + 0.5) / width) * window.innerWidth - left, ((y + 0.5) / height) * window.innerHeight - top];
  }

  /** Take the pose of the workplace by touched points. */
  registerTouched({ workplace, error, grade }: Extract<TouchFit, { grade: unknown }>): void {
    this.correct(this.workplace.register(workplace, "touch", error, this.viewer));
    this.nudge = UNMOVED;
    const found = { grade, touched: 3, used: [], contradicting: [], undecided: false, nudge: null };
    this.options.report({ ...found, checked: true, seenAt: Date.now() });
  }

  /** Handle that another view covers the session, so that the user cannot operate it. */
  private hide(): void {
    this.options.release();
    this.headset?.hide();
  }

  private move(by: Movement): void {
    this.workplace.move(by, this.viewer);
    if (this.workplace.source === "hand") return;
    this.nudge = combined(this.nudge, by);
    this.options.report({ nudge: this.nudgeSize() });
  }

  /** Return how far the user moved the overlay at the markers, m, and by which angle, rad; null if not at all. */
  private nudgeSize(): Ar["nudge"] {
    const { nudge, middles } = this;
    if (nudge === UNMOVED || middles.length === 0) return null;
    const middle = mean(middles);
    return { distance: norm(sub(movedPoint(middle, nudge), middle)), angle: nudge.angle };
  }

  private thaw(): void {
    this.frozen?.dispose();
    this.frozen = null;
    this.options.report({ frozen: false });
  }

  private showFrozen(picture: HTMLCanvasElement, { eyes, camera }: PictureOrigin): void {
    if (!this.workplace.pose) return;
    this.frozen = new FrozenPicture(this.options.engine.scene, picture);
    this.show(camera, eyes);
    this.options.report({ frozen: true });
  }

  private frame(time: number, frame: XRFrame): void {
    const { space, layer, options } = this;
    if (this.ended || !space || !layer) return;
    this.session.requestAnimationFrame((next, another) => this.frame(next, another));
    const seconds = this.lastFrame ? Math.min(0.1, (time - this.lastFrame) / 1000) : 0;
    this.lastFrame = time;
    const pose = frame.getViewerPose(space);
    const tracked = Boolean(pose) && !pose?.emulatedPosition;
    if (!tracked) options.release();
    if (pose && !this.frozen) this.follow(frame, space, pose, tracked);
    this.headset?.frame(frame, space, this.viewer, tracked);
    options.engine.invalidate();
    options.engine.requests.step(seconds);
    this.report(tracked);
  }

  /** Take the pose of the device, place the workplace on the surface ahead, and look for markers. */
  private follow(frame: XRFrame, space: XRReferenceSpace, pose: XRViewerPose, tracked: boolean): void {
    const viewer = matrixOf(pose.transform.matrix);
    this.workplace.follow(frame, space, viewer);
    if (this.placesNext && tracked) {
      const hit = this.hits && frame.getHitTestResults(this.hits)[0]?.getPose(space);
      this.workplace.place(hit ? matrixOf(hit.transform.matrix) : null, viewer);
      this.placesNext = false;
    }
    const eyes = pose.views.map((view) => ({
      pose: matrixOf(view.transform.matrix),
      projection: matrixOf(view.projectionMatrix),
      viewport: this.layer?.getViewport(view) as XRViewport,
    }));
    const [first] = pose.views;
    if (first && tracked) this.pictures?.process(first, eyes);
    if (!this.frozen) this.show(viewer, eyes);
  }

  /** Show the workplace from a pose of the device; the 3D view, a part of the screen, shows its part. */
  private show(viewer: typeof this.viewer, eyes: PictureOrigin["eyes"]): void {
    this.viewer = viewer;
    this.eyes = eyes;
    const { pose } = this.workplace;
    const projection = eyes[0]?.projection;
    if (!pose || !projection) return;
    const { view } = this.options.engine;
    const screen = { width: window.innerWidth, height: window.innerHeight };
    const part = this.headset ? projection : cropped(projection, screen, view.element.getBoundingClientRect());
    const inWorkplace = inverseOf(pose).multiply(viewer);
    view.follow(inWorkplace, (2 * Math.atan(1 / (part.elements[5] as number)) * 180) / Math.PI);
    view.camera.projectionMatrix.copy(part);
    view.camera.projectionMatrixInverse.copy(part).invert();
  }

  private draw(scene: Scene): void {
    if (!this.layer || this.eyes.length === 0) return;
    this.before.background = scene.background ?? this.before.background; // changed with the theme
    this.before.fog = scene.fog ?? this.before.fog;
    scene.background = scene.fog = null;
    const { pose } = this.workplace;
    const [eye] = this.eyes;
    if (pose && eye) this.frozen?.follow(inverseOf(pose).multiply(eye.pose), eye.projection);
    this.output.draw(scene, pose, this.layer, this.eyes, this.phase === "lost" ? LOST : 0);
  }

  private take(found: Found, ms: number, taken: PictureOrigin): void {
    if (this.ended || this.frozen) return;
    const { registration } = found;
    if (registration) {
      const measured = workplaceIn(movedView(registration.view, this.nudge), taken.camera);
      this.correct(this.workplace.register(measured, "markers", registration.error, taken.camera));
      const { grade, used, contradicting, undecided } = registration;
      const nudge = this.nudgeSize();
      this.options.report({
        grade,
        used,
        contradicting,
        undecided,
        nudge,
        checked: true,
        touched: 0,
        seenAt: Date.now(),
      });
    }
    const view = this.workplace.pose && viewOf(this.workplace.pose, taken.camera);
    const count = (this.shown?.count ?? 0) + 1;
    this.shown = { found, view, lens: taken.lens, latency: performance.now() - taken.at, ms, count };
    this.options.report({ loss: found.loss ?? "unseen" });
    this.onPicture();
  }

  private correct(size: number): void {
    if (size > 0) this.correction = { size, at: performance.now() };
  }

  private report(tracked: boolean): void {
    const now = performance.now();
    const { source, at, error, pose } = this.workplace;
    const phase: Ar["phase"] = !pose
      ? "looking"
      : !tracked && !this.frozen
        ? "lost"
        : source === "hand"
          ? "hand"
          : source === "markers" && now - at < FRESH
            ? "registered"
            : "tracked";
    this.sharing.take(phase === "lost" || !pose ? null : viewOf(pose, this.viewer), now);
    if (phase === this.phase && now - this.reportedAt < REPORT) return;
    this.phase = phase;
    this.reportedAt = now;
    const corrected = now - this.correction.at < CORRECTION ? this.correction.size : 0;
    this.options.report({ phase, error, corrected, drifted: this.workplace.drifted });
  }
}
