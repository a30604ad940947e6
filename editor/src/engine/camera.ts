/** The camera: orbit around a point, or fly. z is up. It reports when a frame has to be drawn. */

import { type Matrix4, PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { bestDirection, fitted, marginsOf } from "./framing";

const START = new Vector3(1.5, -1.5, 1.25);
const KEYS: Record<string, [number, number, number]> = {
  KeyW: [0, 0, 1],
  KeyS: [0, 0, -1],
  KeyA: [-1, 0, 0],
  KeyD: [1, 0, 0],
  KeyE: [0, 1, 0],
  KeyQ: [0, -1, 0],
};
/** Speed, m/s. */
const FLY_SPEED = 0.8;

/** `side` is the right side. */
export type ViewName = "home" | "top" | "front" | "side" | "back" | "left";

/** Orbit around the target, or fly with keys and `hold`. */
export type ViewMode = "orbit" | "fly";

/** Position of the camera and its target, in the world. */
export interface Viewpoint {
  position: [number, number, number];
  target: [number, number, number];
}

/** Distance of the target from a flying camera, m; small enough to turn on the spot. */
const NOSE = 0.05;

export class View {
  readonly camera = new PerspectiveCamera(50, 1, 0.01, 100);
  private readonly controls: OrbitControls;
  private readonly pressed = new Set<string>();
  private width = 1;
  private height = 1;
  private fittedTo = { width: 1, height: 1 };
  /** The view before a measured camera was shown; null without a measured camera. */
  private before: (Viewpoint & { fov: number }) | null = null;
  private readonly forget = new AbortController();

  constructor(
    readonly element: HTMLElement,
    private readonly changed: () => void,
  ) {
    this.camera.up.set(0, 0, 1);
    this.camera.position.copy(START);
    this.controls = new OrbitControls(this.camera, element);
    this.controls.target.set(0.2, 0, 0.2);
    this.controls.enableDamping = false; // without inertia: no frames are drawn after the release
    this.controls.maxDistance = 40;
    this.controls.minDistance = 0.05;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", changed);
    this.controls.update();
    const { signal } = this.forget;
    element.addEventListener("keydown", (event) => this.key(event, true), { signal });
    element.addEventListener("keyup", (event) => this.key(event, false), { signal });
    element.addEventListener("blur", () => this.pressed.clear(), { signal });
  }

  resize(width: number, height: number): void {
    this.width = width;
    this.height = height;
    this.camera.aspect = width / Math.max(1, height);
    this.camera.updateProjectionMatrix();
  }

  /** Move a flying camera by the pressed keys for the time since the last frame, s. Return whether it moves. */
  fly(seconds: number): boolean {
    if (this.pressed.size === 0 || this.measured) return false;
    const step = new Vector3();
    for (const key of this.pressed) step.add(new Vector3(...(KEYS[key] ?? [0, 0, 0])));
    const forward = this.camera.getWorldDirection(new Vector3());
    const right = new Vector3().crossVectors(forward, this.camera.up).normalize();
    const move = new Vector3()
      .addScaledVector(right, step.x)
      .addScaledVector(this.camera.up, step.y)
      .addScaledVector(forward, step.z)
      .multiplyScalar(FLY_SPEED * Math.min(seconds, 0.1));
    this.camera.position.add(move);
    this.controls.target.add(move);
    this.controls.update();
    return true;
  }

  /** Show all points as large as possible, from the current direction or from the one in which they fill the view. */
  fit(points: readonly Vector3[], best = false): void {
    if (points.length === 0 || this.measured) return;
    this.setMode("orbit");
    const { width, height } = this;
    const opening = { width, height, fov: this.camera.fov, margins: marginsOf(width, height) };
    const back = best
      ? bestDirection(points, opening)
      : new Vector3().subVectors(this.camera.position, this.controls.target);
    const { position, target } = fitted(points, back, opening);
    this.set(position.toArray(), target.toArray());
    this.fittedTo = { width, height };
  }

  /** Whether the size differs from that of the last fit as it does after a panel opens, not after a message appears. */
  get resizedSinceFit(): boolean {
    const { width, height } = this.fittedTo;
    if (this.measured) return false;
    return Math.abs(Math.log(this.width / width)) > 0.1 || Math.abs(Math.log(this.height / height)) > 0.2;
  }

  get mode(): ViewMode {
    return this.controls.enableZoom ? "orbit" : "fly";
  }

  /** Fly from the current position, or orbit around a point in front of the camera. */
  setMode(mode: ViewMode): void {
    if (mode === this.mode || this.measured) return;
    const ahead = this.camera.getWorldDirection(new Vector3());
    this.controls.enableZoom = this.controls.enablePan = mode === "orbit";
    this.controls.minDistance = mode === "orbit" ? 0.05 : NOSE;
    this.controls.target.copy(this.camera.position).addScaledVector(ahead, mode === "fly" ? NOSE : START.length());
    this.controls.update();
    this.changed();
  }

  /** Whether the camera is where a real one was measured. Then controls and commands do not move it. */
  get measured(): boolean {
    return this.before !== null;
  }

  /** Show the world from a measured camera until `release`. `fov`: vertical field of view, degrees. */
  follow(pose: Matrix4, fov: number): void {
    this.before ??= { ...this.viewpoint, fov: this.camera.fov };
    this.controls.enabled = false;
    pose.decompose(this.camera.position, this.camera.quaternion, this.camera.scale);
    this.camera.fov = fov;
    this.camera.updateProjectionMatrix();
    this.changed();
  }

  /** Return to the previous view, or `stay` at the pose of the camera. */
  release(stay = false): void {
    const { before } = this;
    if (!before) return;
    this.before = null;
    this.controls.enabled = true;
    this.camera.fov = before.fov;
    this.camera.updateProjectionMatrix();
    if (stay) {
      const ahead = this.camera.getWorldDirection(new Vector3());
      before.position = this.camera.position.toArray();
      before.target = this.camera.position.clone().addScaledVector(ahead, 1).toArray();
    }
    this.set(before.position, before.target);
  }

  /** Fly while held; `key` is a key code: KeyW forward, KeyE up, and so on. */
  hold(key: string, down: boolean): void {
    if (down && key in KEYS) this.pressed.add(key);
    else this.pressed.delete(key);
    this.changed();
  }

  get viewpoint(): Viewpoint {
    return { position: this.camera.position.toArray(), target: this.controls.target.toArray() };
  }

  /** Look at the target from a side. */
  lookFrom(from: ViewName): void {
    if (this.measured) return;
    this.setMode("orbit");
    const distance = this.camera.position.distanceTo(this.controls.target);
    const direction = {
      home: new Vector3(1, -1, 0.75),
      top: new Vector3(0, -1e-3, 1),
      front: new Vector3(0, -1, 0.12),
      side: new Vector3(1, 0, 0.12),
      back: new Vector3(0, 1, 0.12),
      left: new Vector3(-1, 0, 0.12),
    }[from].normalize();
    this.camera.position.copy(this.controls.target).addScaledVector(direction, distance);
    this.controls.update();
    this.changed();
  }

  set(position: [number, number, number], target: [number, number, number]): void {
    if (this.measured) return;
    this.camera.position.set(...position);
    this.controls.target.set(...target);
    this.controls.update();
    this.changed();
  }

  get target(): Vector3 {
    return this.controls.target;
  }

  /** Disabled while another item is dragged. */
  enable(on: boolean): void {
    this.controls.enabled = on && !this.measured;
  }

  dispose(): void {
    this.forget.abort();
    this.controls.dispose();
    this.element.style.touchAction = "";
  }

  private key(event: KeyboardEvent, down: boolean): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (!(event.code in KEYS)) return;
    if (down) this.pressed.add(event.code);
    else this.pressed.delete(event.code);
    this.changed();
  }
}
