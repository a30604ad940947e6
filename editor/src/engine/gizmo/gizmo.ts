/**
 * The gizmo that moves, turns and resizes an item: arrows, squares, rings, knobs. It reports drags in world
 * coordinates; its user shows the item (`show`) and applies the change (`onDrag`).
 */

import { type Camera, Quaternion, Raycaster, type Scene, Vector2, Vector3 } from "three";
import type { Orientation, Position } from "../../protocol/types";
import { alongAxis, angleBetween, onPlane, unwound } from "./drags";
import {
  AXES,
  type Axis,
  distanceToOutline,
  type GizmoMode,
  type Handle,
  handlesOf,
  keyOf,
  onScreen,
  outline,
  UNIT,
} from "./handles";
import { Picture } from "./picture";

export interface GizmoSetup {
  mode: GizmoMode;
  /** Pose in the world; `view`: axes of the camera. */
  at: Position;
  axes: Orientation | "view";
  /** Axes; all three by default. */
  allowed?: readonly Axis[];
  /** Half extents along the own axes of an item that can be resized, m. */
  half?: Record<Axis, number>;
}

/** The drag since it started. */
export interface Drag {
  phase: "start" | "move" | "end" | "cancel";
  handle: Handle;
  /** Translation in the world, m. */
  translation: Vector3;
  /** Distance along the axis of the handle, outwards for a face, m. */
  length: number;
  /** Angle about the axis of the handle, rad; can exceed a full turn. */
  angle: number;
  /** Axis of the handle in the world at the start; for `free`, towards the camera. */
  axis: Vector3;
  /** The pointer, px from the upper left corner of the view. */
  x: number;
  y: number;
}

export interface Surroundings {
  canvas: HTMLCanvasElement;
  scene: Scene;
  camera: () => Camera;
  size: () => { width: number; height: number };
  draw: () => void;
}

/** Length of an arrow, and distance within which a handle is hit, px. */
const LENGTH = 96;
const NEAR_MOUSE = 10;
const NEAR_FINGER = 24;
/** Shortest length on the screen of a handle that can be dragged, px. */
const SHORT = 22;

export class Gizmo {
  /** Called during a drag. */
  onDrag: (drag: Drag) => void = () => {};

  private setup: GizmoSetup | null = null;
  private readonly picture: Picture;
  private readonly caster = new Raycaster();
  private readonly forget = new AbortController();
  private lit = "";
  private dragging: {
    handle: Handle;
    pointer: number;
    from: Vector3;
    origin: Vector3;
    axis: Vector3;
    last: Drag;
  } | null = null;

  constructor(private readonly around: Surroundings) {
    this.picture = new Picture(around.scene);
    const { canvas } = around;
    const options = { capture: true, signal: this.forget.signal };
    canvas.addEventListener("pointerdown", (event) => this.down(event), options);
    canvas.addEventListener("pointermove", (event) => this.move(event), options);
    canvas.addEventListener("pointerup", (event) => this.up(event, "end"), options);
    canvas.addEventListener("pointercancel", (event) => this.up(event, "cancel"), options);
    window.addEventListener("keydown", (event) => this.key(event), options);
  }

  get shown(): boolean {
    return this.setup !== null;
  }

  get isDragging(): boolean {
    return this.dragging !== null;
  }

  show(setup: GizmoSetup): void {
    this.setup = setup;
    this.picture.show(handlesOf(setup.mode, setup.allowed ?? AXES));
    this.around.draw();
  }

  hide(): void {
    if (this.dragging) this.finish("cancel");
    if (!this.setup) return;
    this.setup = null;
    this.picture.show([]);
    this.around.draw();
  }

  /** Return the positions of its handles on the screen by name, px: for tests and hints. */
  places(): Record<string, { x: number; y: number }> {
    const { setup } = this;
    if (!setup) return {};
    return Object.fromEntries(
      handlesOf(setup.mode, setup.allowed ?? AXES).map((handle) => {
        const line = this.line(handle);
        const { x, y } = line[handle.kind === "ring" ? 6 : line.length - 1] ?? { x: 0, y: 0 };
        return [keyOf(handle), { x, y }];
      }),
    );
  }

  /** Called before each frame; keeps the size on the screen constant. */
  place(): void {
    if (!this.setup) return;
    this.picture.place(this.origin(), this.turned(), this.scale(), this.half(), (handle) => this.isShort(handle));
  }

  dispose(): void {
    this.forget.abort();
    this.picture.dispose();
  }

  // ------------------------------------------------------------------------------------------------ pose
  private origin(): Vector3 {
    const { x, y, z } = this.setup?.at ?? { x: 0, y: 0, z: 0 };
    return new Vector3(x, y, z);
  }

  private turned(): Quaternion {
    const axes = this.setup?.axes ?? "view";
    if (axes === "view") return this.around.camera().getWorldQuaternion(new Quaternion());
    return new Quaternion(axes.x, axes.y, axes.z, axes.w).normalize();
  }

  /** Return the length in the world, m, of `LENGTH` pixels at the gizmo. */
  private scale(): number {
    const camera = this.around.camera();
    const origin = this.origin();
    const right = new Vector3(1, 0, 0).applyQuaternion(camera.getWorldQuaternion(new Quaternion()));
    const { width, height } = this.around.size();
    const a = onScreen(origin, camera, width, height);
    const b = onScreen(origin.clone().addScaledVector(right, 0.01), camera, width, height);
    return (0.01 * LENGTH) / Math.max(0.01, Math.hypot(a.x - b.x, a.y - b.y));
  }

  /** Return the half extent in lengths of the gizmo; a knob is a bit outside its face. */
  private half(): Record<Axis, number> {
    const { half } = this.setup ?? {};
    const scale = this.scale();
    const of = (axis: Axis) => (half ? half[axis] / scale + 0.18 : 1);
    return { x: of("x"), y: of("y"), z: of("z") };
  }

  private line(handle: Handle) {
    const { width, height } = this.around.size();
    const camera = this.around.camera();
    const origin = this.origin();
    const turned = this.turned();
    const scale = this.scale();
    return outline(handle, this.half()).map((point) =>
      onScreen(point.multiplyScalar(scale).applyQuaternion(turned).add(origin), camera, width, height),
    );
  }

  /** Return whether an arrow or knob points at the camera and cannot be dragged. */
  private isShort(handle: Handle): boolean {
    if (handle.kind !== "axis" && handle.kind !== "face") return false;
    const line = this.line({ kind: "axis", axis: handle.axis });
    const [a, b] = line;
    return !a || !b || Math.hypot(a.x - b.x, a.y - b.y) < SHORT;
  }

  private at(x: number, y: number, near: number): Handle | null {
    const { setup } = this;
    if (!setup) return null;
    const { width, height } = this.around.size();
    const centre = onScreen(this.origin(), this.around.camera(), width, height);
    let best: Handle | null = null;
    let least = near;
    for (const handle of handlesOf(setup.mode, setup.allowed ?? AXES)) {
      if (this.isShort(handle)) continue;
      const distance = distanceToOutline(x, y, this.line(handle), centre);
      if (distance >= least) continue;
      best = handle;
      least = distance;
    }
    return best;
  }

  // ------------------------------------------------------------------------------------------------ drag
  private pointer(event: PointerEvent): { x: number; y: number } {
    const box = this.around.canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  private down(event: PointerEvent): void {
    if (!this.setup || !event.isPrimary || event.button !== 0 || this.dragging) return;
    const { x, y } = this.pointer(event);
    const handle = this.at(x, y, event.pointerType === "mouse" ? NEAR_MOUSE : NEAR_FINGER);
    if (!handle) return;
    event.stopImmediatePropagation();
    this.around.canvas.setPointerCapture(event.pointerId);
    const origin = this.origin();
    const towards = new Vector3(0, 0, 1).applyQuaternion(this.around.camera().getWorldQuaternion(new Quaternion()));
    const axis = handle.kind === "free" ? towards : UNIT[handle.axis].clone().applyQuaternion(this.turned());
    if (handle.kind === "face") axis.multiplyScalar(handle.sign);
    const last: Drag = { phase: "start", handle, translation: new Vector3(), length: 0, angle: 0, axis, x, y };
    const from = this.reach(handle, x, y, origin, axis) ?? origin.clone();
    this.dragging = { handle, pointer: event.pointerId, from, origin, axis, last };
    this.highlight(keyOf(handle));
    this.onDrag(last);
  }

  /** Return the pointer position on the axis or plane of the handle. */
  private reach(handle: Handle, x: number, y: number, origin: Vector3, axis: Vector3): Vector3 | null {
    const { width, height } = this.around.size();
    this.caster.setFromCamera(new Vector2((x / width) * 2 - 1, 1 - (y / height) * 2), this.around.camera());
    const { ray } = this.caster;
    if (handle.kind !== "axis" && handle.kind !== "face") return onPlane(ray, origin, axis);
    const along = alongAxis(ray, origin, axis);
    return along === null ? null : origin.clone().addScaledVector(axis, along);
  }

  private move(event: PointerEvent): void {
    const { x, y } = this.pointer(event);
    const { dragging } = this;
    if (!dragging) {
      if (this.setup && event.pointerType === "mouse" && !event.buttons) {
        const handle = this.at(x, y, NEAR_MOUSE);
        this.highlight(handle ? keyOf(handle) : "");
      }
      return;
    }
    if (event.pointerId !== dragging.pointer) return;
    event.stopImmediatePropagation();
    const { handle, from, origin, axis, last } = dragging;
    const to = this.reach(handle, x, y, origin, axis);
    if (!to) return; // the pointer is above the horizon: keep the last position
    const translation = new Vector3().subVectors(to, from);
    const ring = handle.kind === "ring";
    const angle = ring ? unwound(angleBetween(from.clone().sub(origin), to.clone().sub(origin), axis), last.angle) : 0;
    dragging.last = {
      phase: "move",
      handle,
      translation: ring ? new Vector3() : translation,
      length: translation.dot(axis),
      angle,
      axis,
      x,
      y,
    };
    this.onDrag(dragging.last);
    this.around.draw();
  }

  private up(event: PointerEvent, phase: "end" | "cancel"): void {
    if (event.pointerId !== this.dragging?.pointer) return;
    event.stopImmediatePropagation();
    this.finish(phase);
  }

  private key(event: KeyboardEvent): void {
    if (event.key !== "Escape" || !this.dragging) return;
    event.stopImmediatePropagation();
    this.finish("cancel");
  }

  private finish(phase: "end" | "cancel"): void {
    const { dragging } = this;
    if (!dragging) return;
    this.dragging = null;
    const { canvas } = this.around;
    if (canvas.hasPointerCapture(dragging.pointer)) canvas.releasePointerCapture(dragging.pointer);
    this.highlight("");
    this.onDrag({ ...dragging.last, phase });
    this.around.draw();
  }

  private highlight(key: string): void {
    if (key === this.lit) return;
    this.lit = key;
    this.picture.highlight(key);
    this.around.canvas.style.cursor = key ? "grab" : "";
    this.around.draw();
  }
}
