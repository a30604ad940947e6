/**
 * The 3D view: shows items, follows robots, tells what was tapped. No React in it, and nothing is drawn unless
 * something changed.
 */

import { Box3, Fog, GridHelper, PCFShadowMap, Scene, SRGBColorSpace, Vector3, WebGLRenderer } from "three";
import type { Telemetry } from "../store/telemetry";
import { Batches } from "./batches";
import { View } from "./camera";
import { DropLine, heightWords } from "./drop";
import { Gizmo } from "./gizmo/gizmo";
import type { Item } from "./items";
import { Labels } from "./labels";
import { light } from "./light";
import { labelsOf } from "./naming";
import { DARK, LIGHT, type Palette } from "./palette";
import { type Hit, onFloor, pick } from "./picking";
import { followPointer } from "./pointer";
import { type Probe, probe } from "./probe";
import type { Quality } from "./surface";
import type { Context, Thing } from "./thing";
import { make } from "./things/make";
import { type JointLimit, RobotThing } from "./things/robot";
import { Ties } from "./ties";
import { type Way, WayLine } from "./way";

export type { Quality };

export interface EngineOptions {
  canvas: HTMLCanvasElement;
  labels: HTMLElement;
  telemetry: Telemetry;
  asset: Context["asset"];
  trouble: Context["trouble"];
  quality: Quality;
  dark: boolean;
}

const SMALL = new Set<Item["kind"]>(["point", "orientation", "action", "logic"]);
/** s between two frames. */
const PERIODS: Record<Quality, number> = { low: 1 / 30, high: 1 / 60 };

export class Engine {
  readonly view: View;
  readonly scene = new Scene();
  /** Moves, turns and sizes what the transform tool has in hand. */
  readonly gizmo: Gizmo;
  /** Frames drawn since the start. */
  frames = 0;
  onTap: (hits: Hit[], floor: Vector3 | null) => void = () => {};

  private readonly watchers = new Set<() => void>();
  private readonly renderer: WebGLRenderer;
  private readonly things = new Map<string, Thing>();
  private readonly batches: Batches;
  private readonly labels: Labels;
  private readonly context: Context;
  private grid: GridHelper | null = null;
  private palette: Palette = LIGHT;
  private scheduled = 0;
  private last = 0;
  /** When the next frame may be drawn, ms. */
  private due = 0;
  /** Frames of things may have changed since the last drawn frame. */
  private dirty = true;
  /** Robots whose joints have changed since then, and nothing else. */
  private readonly stirred = new Set<RobotThing>();
  private width = 1;
  private height = 1;
  private hovered = "";
  /** Where the eye was put when all was brought into view. */
  private fitted: Vector3 | null = null;
  private readonly notes = new Map<string, string>();
  /** What is said of a thing while somebody moves it, in place of how high it is. */
  private said = { id: "", text: "" };
  private readonly drop: DropLine;
  /** Lines from points to what they hang on. */
  readonly ties: Ties;
  private readonly wayLine: WayLine;
  private readonly ends: (() => void)[] = [];

  constructor(private readonly options: EngineOptions) {
    const { canvas, quality } = options;
    // Nothing is seen through the view: what draws pages need not look for what is behind it.
    const context = canvas.getContext("webgl2", {
      alpha: false,
      antialias: quality !== "low",
      powerPreference: "low-power",
    });
    this.renderer = new WebGLRenderer({ canvas, ...(context && { context }) });
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.renderer.setPixelRatio(quality === "low" ? 1 : Math.min(2, window.devicePixelRatio));
    this.renderer.shadowMap.enabled = quality === "high";
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.shadowMap.autoUpdate = false;
    this.view = new View(canvas, () => this.draw());
    this.batches = new Batches(this.scene, quality === "low");
    this.labels = new Labels(options.labels);
    this.context = {
      telemetry: options.telemetry,
      palette: this.palette,
      batches: this.batches,
      quality,
      period: PERIODS[quality],
      asset: options.asset,
      trouble: options.trouble,
      thing: (id) => this.things.get(id),
      metresPerPixel: (at) =>
        (2 * this.view.camera.position.distanceTo(at) * Math.tan((this.view.camera.fov * Math.PI) / 360)) / this.height,
      invalidate: () => this.invalidate(),
      loaded: () => this.loaded(),
    };
    this.drop = new DropLine(this.scene);
    this.ties = new Ties(this.scene);
    this.wayLine = new WayLine(this.scene);
    this.gizmo = new Gizmo({
      canvas,
      scene: this.scene,
      camera: () => this.view.camera,
      size: () => ({ width: this.width, height: this.height }),
      draw: () => this.draw(),
    });
    this.ends.push(light(this.scene, quality === "high"));
    this.setDark(options.dark);
    this.ends.push(options.telemetry.subscribe((id) => this.reported(id)));
    const ageing = setInterval(() => this.checkAges(), 250);
    this.ends.push(() => clearInterval(ageing));
    const watch = new ResizeObserver(() => this.resize());
    watch.observe(canvas.parentElement ?? canvas);
    this.ends.push(() => watch.disconnect());
    this.ends.push(
      followPointer(canvas, {
        onTap: (x, y, slack) => this.onTap(this.pick(x, y, slack), this.floor(x, y)),
        onHover: (x, y) => this.hover(this.pick(x, y, 4)[0]?.id ?? ""),
      }),
    );
    this.resize();
  }

  /** Show these items and no others. What is the same object as before is left alone. */
  show(items: Iterable<Item>): void {
    const wanted = new Set<string>();
    let changed = false;
    for (const item of items) {
      wanted.add(item.id);
      let thing = this.things.get(item.id);
      if (thing && thing.item.kind !== item.kind) {
        this.remove(item.id, thing);
        thing = undefined;
      }
      if (thing?.item === item) continue;
      changed = true;
      if (!thing) {
        thing = make(item, this.context);
        this.things.set(item.id, thing);
      }
      thing.update(item);
    }
    for (const [id, thing] of [...this.things]) {
      if (wanted.has(id)) continue;
      this.remove(id, thing);
      changed = true;
    }
    if (!changed) return;
    for (const thing of this.things.values()) this.hang(thing);
    this.invalidate();
  }

  /** Say something beside a thing's name; nothing is said any more with empty words. */
  note(id: string, text: string): void {
    this.said = { id: text ? id : "", text };
    this.draw();
  }

  /** Show the straight way to somewhere, in place of another; null: none. */
  showWay(way: Way | null): void {
    if (this.wayLine.show(way, this.palette)) this.draw();
  }

  get way(): Way | null {
    return this.wayLine.shown;
  }

  /** Show the label of what the pointer is on. */
  hover(id: string): void {
    if (id === this.hovered) return;
    this.hovered = id;
    this.draw();
  }

  setDark(dark: boolean): void {
    this.palette = dark ? DARK : LIGHT;
    this.context.palette = this.palette;
    this.scene.background = this.palette.background;
    this.scene.fog = new Fog(this.palette.background, 9, 26);
    this.grid?.removeFromParent();
    this.grid?.dispose();
    this.grid = new GridHelper(20, 40, this.palette.gridStrong, this.palette.grid);
    this.grid.rotateX(Math.PI / 2);
    this.grid.position.z = -0.001;
    this.scene.add(this.grid);
    for (const thing of this.things.values()) thing.update(thing.item);
    this.invalidate();
  }

  /** What lies under a place of the view, in pixels, the best first. */
  pick(x: number, y: number, slack = 12): Hit[] {
    this.place();
    const roots = this.scene.children.filter((each) => each !== this.grid && !each.userData.ground);
    return pick(x, y, { width: this.width, height: this.height }, this.view.camera, roots, slack, (id) => {
      const kind = this.things.get(id)?.item.kind;
      return kind !== undefined && SMALL.has(kind);
    });
  }

  /** What is shown, where it is drawn, and how large the view is in pixels: for what is laid over it. */
  shown(): { things: ReadonlyMap<string, Thing>; width: number; height: number } {
    this.place();
    return { things: this.things, width: this.width, height: this.height };
  }

  /** Be called after each drawn frame; gives what ends that. */
  watch(by: () => void): () => void {
    this.watchers.add(by);
    return () => this.watchers.delete(by);
  }

  /** Where a place of the view is on the floor, or on a level above it, m. */
  floor(x: number, y: number, level = 0): Vector3 | null {
    return onFloor(x, y, { width: this.width, height: this.height }, this.view.camera, 20, level);
  }

  /** Bring an item, or all, into the view. */
  focus(id?: string): void {
    this.place();
    const box = new Box3();
    const spot = new Vector3();
    for (const [key, thing] of this.things) {
      if (id !== undefined && key !== id) continue;
      box.expandByObject(thing.root);
      box.expandByPoint(thing.anchor(spot));
    }
    if (id !== undefined) box.expandByScalar(0.12);
    this.view.fit(box);
    this.fitted = id === undefined ? this.view.camera.position.clone() : null;
  }

  /** What was all in view is so again with what came, unless somebody has moved since. */
  private loaded(): void {
    if (this.fitted?.equals(this.view.camera.position)) this.focus();
    this.invalidate();
  }

  item(id: string): Probe | undefined {
    const thing = this.things.get(id);
    if (!thing) return undefined;
    this.place();
    return probe(thing, this.context.telemetry, this.view.camera, { width: this.width, height: this.height });
  }

  /** Joints of a robot with their limits; none while its model is not loaded, or where it has none. */
  limits(id: string): JointLimit[] {
    const thing = this.things.get(id);
    return thing instanceof RobotThing ? thing.limits() : [];
  }

  ids(): string[] {
    return [...this.things.keys()];
  }

  /** Something moved or looks another way. */
  invalidate(): void {
    this.dirty = true;
    this.draw();
  }

  /** A picture of the view as it is. */
  async picture(type = "image/webp"): Promise<Blob | null> {
    this.render();
    return new Promise((resolve) => this.options.canvas.toBlob(resolve, type, 0.8));
  }

  dispose(): void {
    for (const end of this.ends) end();
    cancelAnimationFrame(this.scheduled);
    for (const [id, thing] of [...this.things]) this.remove(id, thing);
    this.batches.dispose();
    this.labels.dispose();
    this.gizmo.dispose();
    this.drop.dispose();
    this.ties.dispose();
    this.wayLine.dispose();
    this.grid?.dispose();
    this.view.dispose();
    this.renderer.dispose();
  }

  private remove(id: string, thing: Thing): void {
    if (thing instanceof RobotThing) this.stirred.delete(thing);
    // What hangs on it gets its own place by `hang`, or goes by itself.
    for (const other of this.things.values()) if (other.root.parent === thing.root) other.root.removeFromParent();
    thing.dispose();
    this.things.delete(id);
  }

  /** Put a thing into its parent's frame. */
  private hang(thing: Thing): void {
    const { parent } = thing.item as { parent?: string };
    const frame = (parent !== undefined && this.things.get(parent)?.root) || this.scene;
    if (thing.root.parent !== frame) frame.add(thing.root);
  }

  private reported(id: string): void {
    const thing = this.things.get(id);
    if (!(thing instanceof RobotThing) || !thing.moved()) return;
    this.stirred.add(thing);
    this.draw();
  }

  private checkAges(): void {
    for (const thing of this.things.values()) if (thing instanceof RobotThing && thing.checkAge()) this.invalidate();
  }

  private resize(): void {
    const host = this.options.canvas.parentElement ?? this.options.canvas;
    this.width = Math.max(1, host.clientWidth);
    this.height = Math.max(1, host.clientHeight);
    this.renderer.setSize(this.width, this.height, false);
    this.view.resize(this.width, this.height);
    this.draw();
  }

  private draw(): void {
    if (this.scheduled) return;
    this.scheduled = requestAnimationFrame((time) => {
      this.scheduled = 0;
      const seconds = (time - this.last) / 1000;
      if (this.options.quality === "low" && time < this.due - 3) {
        this.draw();
        return;
      }
      this.last = time;
      // A frame that came late does not keep the next one back.
      const period = this.context.period * 1000;
      this.due = Math.max(this.due + period, time + period / 2);
      const flying = this.view.fly(seconds);
      this.render();
      if (flying) this.draw();
    });
  }

  /** Bring all frames up to date, or those of robots alone, on whose joints nothing else hangs. */
  private place(): void {
    const stirred = [...this.stirred];
    this.stirred.clear();
    if (!this.dirty) {
      for (const robot of stirred) {
        if (robot.frame()) this.stirred.add(robot);
        robot.root.updateMatrixWorld();
        this.renderer.shadowMap.needsUpdate = true;
      }
      return;
    }
    this.dirty = false;
    this.scene.updateMatrixWorld();
    for (const thing of this.things.values()) if (thing instanceof RobotThing && thing.frame()) this.stirred.add(thing);
    this.scene.updateMatrixWorld();
    for (const thing of this.things.values()) if (thing.item.kind !== "logic") thing.placed();
    for (const thing of this.things.values()) if (thing.item.kind === "logic") thing.placed();
    this.scene.updateMatrixWorld();
    this.batches.refresh();
    this.ties.show(this.things, this.palette);
    this.renderer.shadowMap.needsUpdate = true;
  }

  private render(): void {
    for (const thing of this.things.values()) if (thing.resized()) this.dirty = true;
    this.place();
    this.gizmo.place();
    this.tellHeight();
    this.renderer.render(this.scene, this.view.camera);
    this.frames++;
    this.labels.show(
      labelsOf(this.things, this.hovered, this.notes, this.view.camera.position),
      this.view.camera,
      this.width,
      this.height,
    );
    for (const watcher of this.watchers) watcher();
    if (this.stirred.size > 0) this.draw();
  }

  /** The line below what is selected, and how high it is. */
  private tellHeight(): void {
    this.notes.clear();
    const chosen = [...this.things.values()].find((each) => each.item.selected && each.item.kind !== "logic");
    const at = chosen && chosen.item.faint < 1 ? chosen.root.getWorldPosition(new Vector3()) : null;
    const height = this.drop.show(at, this.palette);
    if (chosen) this.notes.set(chosen.item.id, heightWords(height));
    if (this.said.id) this.notes.set(this.said.id, this.said.text);
  }
}
