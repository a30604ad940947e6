/**
 * Controllers and hands of a headset: their rays press buttons of the panel, select and move items, and touch known
 * points. A hold-to-run motion stops when its controller or hand is no longer tracked.
 */

import {
  DoubleSide,
  type Matrix4,
  Mesh,
  MeshBasicMaterial,
  type PerspectiveCamera,
  PlaneGeometry,
  type Scene,
  Vector3,
} from "three";
import type { Engine } from "../engine/engine";
import type { Hit } from "../engine/picking";
import type { Ar } from "../store/ui";
import { mean, norm, sub, type Vec3 } from "./geometry";
import { Panel, type PanelButton } from "./panel";
import type { Layout } from "./places";
import type { KnownPoint } from "./touch";
import { inverseOf, matrixOf } from "./xrView";

/** Buttons of xr-standard gamepads that stop motion: A or X, and B or Y. */
const STOP_BUTTONS = [4, 5];
/** Buttons of the panel that work while points are touched. */
const TOUCHING = ["touch", "stop"];
/** Width of a ray, its length if it hits nothing, m, and half the angle in which it hits small items, rad. */
const WIDTH = 0.004;
const LENGTH = 3;
const CONE = 0.02;
/** Movement of the tip during a touch above which the touch does not count, m, and the fewest frames of one. */
const MAX_TOUCH_MOVEMENT = 0.01;
const FRAMES = 3;

/** Moves an item that a ray has grabbed. `to` takes the new position of the grabbed point in the workplace. */
export type Grab = { to: (at: Vector3) => void; end: () => void };

export interface HeadsetHost {
  engine: Engine;
  layout: Layout;
  /** Pose of the workplace in the frame of WebXR. */
  workplace: () => Matrix4 | null;
  report: (state: Partial<Ar>) => void;
  /** Stop the hold-to-run motion. */
  release: () => void;
  stopMotion: () => void;
  /** Called when no stop button is available any more. */
  stopOutOfReach: () => void;
  /** Start to move an item; null if it is not selected or cannot be moved. */
  grab: (id: string, at: Vector3) => Grab | null;
}

/** The gesture of a controller or hand from press to release. */
interface Press {
  source: XRInputSource;
  end: () => unknown;
  /** The item that it moves, and its distance along the ray, m. */
  grab?: Grab;
  distance?: number;
  /** Positions of the tip, if it touches a point. */
  tips?: Vec3[];
}

interface Touching {
  known: readonly KnownPoint[];
  points: Vec3[];
  /** Called before the next touch with its number, from 1. */
  next: (number: number) => void;
  /** Called with the touched points. */
  done: (points: readonly Vec3[]) => void;
}

export class Headset {
  readonly panel: Panel;
  private readonly rays = new Map<XRInputSource, Mesh<PlaneGeometry, MeshBasicMaterial>>();
  private readonly poses = new Map<XRInputSource, Matrix4>();
  private readonly tips = new Map<XRInputSource, Vec3>();
  private readonly camera: PerspectiveCamera;
  private readonly forget = new AbortController();
  private press: Press | null = null;
  private touching: Touching | null = null;
  private pressedStop = false;
  private reported: boolean | null = null;

  constructor(
    private readonly session: XRSession,
    private readonly scene: Scene,
    private readonly host: HeadsetHost,
  ) {
    this.panel = new Panel(scene);
    this.camera = host.engine.view.camera.clone();
    this.camera.fov = (4 * CONE * 180) / Math.PI;
    const { signal } = this.forget;
    const on = (event: string, act: (event: XRInputSourceEvent) => void) =>
      session.addEventListener(event, act as unknown as EventListener, { signal });
    on("selectstart", ({ inputSource }) => this.start(inputSource));
    on("selectend", ({ inputSource }) => this.press?.source === inputSource && this.end());
    on("inputsourceschange", (event) => {
      for (const source of (event as unknown as XRInputSourcesChangeEvent).removed) this.lose(source);
    });
  }

  /** Let the user touch known points; null cancels it. */
  touch(touching: Omit<Touching, "points"> | null): void {
    this.touching = touching && { ...touching, points: [] };
  }

  /** Update the poses of controllers and hands in a frame. */
  frame(frame: XRFrame, space: XRReferenceSpace, viewer: Matrix4, tracked: boolean): void {
    this.panel.follow(viewer);
    this.readButtons();
    let hovered = "";
    for (const source of this.session.inputSources) {
      const pose = frame.getPose(source.targetRaySpace, space);
      if (!pose || pose.emulatedPosition) {
        this.lose(source);
        continue;
      }
      const ray = matrixOf(pose.transform.matrix);
      this.poses.set(source, ray);
      this.tips.set(source, tipOf(frame, space, source, ray));
      const hit = this.panel.hit(ray);
      hovered ||= hit?.button?.id ?? "";
      this.drawRay(source, ray, hit?.distance ?? this.itemAt(ray)?.distance ?? LENGTH);
    }
    this.panel.hover(hovered);
    if (!tracked) this.end();
    this.continuePress();
  }

  /** Handle that the user can reach neither the panel nor the buttons. */
  hide(): void {
    this.end();
    this.reach(false);
  }

  dispose(): void {
    this.forget.abort();
    this.end();
    for (const source of [...this.rays.keys()]) this.lose(source);
    this.panel.dispose();
  }

  /** Stop by the buttons of controllers. They work where the headset does not see the controller, too. */
  private readButtons(): void {
    const stops = [...this.session.inputSources].flatMap(({ gamepad }) =>
      gamepad?.mapping === "xr-standard" ? STOP_BUTTONS.flatMap((n) => gamepad.buttons[n] ?? []) : [],
    );
    const pressed = stops.some((each) => each.pressed);
    // Every Stop acts on press, not on release.
    if (pressed && !this.pressedStop) this.host.stopMotion();
    this.pressedStop = pressed;
    // Browsers pass no buttons to a session that is covered.
    this.reach(stops.length > 0 && this.session.visibilityState === "visible");
  }

  /** Report whether a button stops motion. */
  private reach(stopButton: boolean): void {
    if (stopButton === this.reported) return;
    this.reported = stopButton;
    if (!stopButton) this.host.stopOutOfReach();
    this.host.report({ stopButton });
  }

  private start(source: XRInputSource): void {
    this.end();
    const ray = this.poses.get(source);
    if (!ray) return;
    const hit = this.panel.hit(ray);
    // The ray of a controller that touches a point may continue to the panel.
    const meant = this.touching ? TOUCHING.includes(hit?.button?.id ?? "") : hit !== null;
    if (meant && hit) this.pressButton(source, hit.button);
    else if (this.touching) this.press = { source, tips: [], end: () => this.touched() };
    else this.aim(source, ray);
  }

  private pressButton(source: XRInputSource, button: PanelButton | null): void {
    if (!button || button.disabled) return;
    const end = button.press();
    this.press = { source, end: () => typeof end === "function" && end() };
  }

  /** Select the item at a ray; the selected one is moved instead. */
  private aim(source: XRInputSource, ray: Matrix4): void {
    const workplace = this.host.workplace();
    if (!workplace) return;
    const hits = this.itemsAt(ray, workplace);
    const [first] = hits;
    const grab = first ? this.host.grab(first.id, first.point) : null;
    if (grab && first) {
      this.press = { source, grab, distance: first.distance, end: () => grab.end() };
    } else {
      this.host.engine.onTap(hits, null);
    }
  }

  /** Continue the pressed operations: move an item, or collect positions of the tip. */
  private continuePress(): void {
    const { press } = this;
    if (!press) return;
    const ray = this.poses.get(press.source);
    const tip = this.tips.get(press.source);
    if (press.tips && tip) press.tips.push(tip);
    const workplace = this.host.workplace();
    if (!press.grab || !ray || !workplace) return;
    const at = new Vector3(0, 0, -(press.distance ?? 0)).applyMatrix4(ray);
    press.grab.to(at.applyMatrix4(inverseOf(workplace)));
  }

  private touched(): void {
    const { touching, press } = this;
    const tips = press?.tips ?? [];
    if (!touching || tips.length < FRAMES) return;
    const middle = mean(tips);
    if (Math.max(...tips.map((each) => norm(sub(each, middle)))) > MAX_TOUCH_MOVEMENT) return;
    const { points, known, next, done } = touching;
    points.push(middle);
    if (points.length < known.length) return next(points.length);
    this.touching = null;
    done(points);
  }

  private end(): void {
    const { press } = this;
    press?.end();
    this.press = null;
  }

  /** Handle a controller or hand that is no longer tracked: end its operations, and every motion. */
  private lose(source: XRInputSource): void {
    const ray = this.rays.get(source);
    ray?.removeFromParent();
    ray?.geometry.dispose();
    ray?.material.dispose();
    this.rays.delete(source);
    this.tips.delete(source);
    if (!this.poses.delete(source)) return;
    this.host.release();
    if (this.press?.source === source) this.end();
  }

  private itemAt(ray: Matrix4): Hit | undefined {
    const workplace = this.host.workplace();
    return workplace ? this.itemsAt(ray, workplace)[0] : undefined;
  }

  private itemsAt(ray: Matrix4, workplace: Matrix4): Hit[] {
    const { engine } = this.host;
    const { width, height } = engine.shown();
    const { camera } = this;
    inverseOf(workplace).multiply(ray).decompose(camera.position, camera.quaternion, camera.scale);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    // The picture along the ray is four cones high.
    return engine.pick(width / 2, height / 2, height / 4, camera);
  }

  private drawRay(source: XRInputSource, ray: Matrix4, length: number): void {
    let line = this.rays.get(source);
    if (!line) {
      const geometry = new PlaneGeometry(WIDTH, 1).rotateX(-Math.PI / 2).translate(0, 0, -0.5);
      line = new Mesh(geometry, new MeshBasicMaterial({ color: "#ffffff", side: DoubleSide }));
      line.matrixAutoUpdate = line.frustumCulled = false;
      this.scene.add(line);
      this.rays.set(source, line);
    }
    line.matrix.copy(ray).scale(new Vector3(1, 1, length));
    line.matrixWorldNeedsUpdate = true;
  }
}

/** Return the position of the tip of a finger, or of a controller, where its ray starts. */
function tipOf(frame: XRFrame, space: XRReferenceSpace, { hand }: XRInputSource, ray: Matrix4): Vec3 {
  const joint = hand?.get("index-finger-tip");
  const finger = joint && frame.getJointPose?.(joint, space);
  if (!finger) return new Vector3().setFromMatrixPosition(ray).toArray();
  const { x, y, z } = finger.transform.position;
  return [x, y, z];
}
