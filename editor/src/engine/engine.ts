/** The 3D view: shows items, follows robots, reports taps. It does not use React, and draws only after changes. */

import { type Camera, Fog, Scene, type Vector3 } from "three";
import type { Telemetry } from "../store/telemetry";
import { checkAges } from "./ages";
import { Animation } from "./animation";
import { Batches } from "./batches";
import { View } from "./camera";
import { Fitting } from "./fitting";
import { Floor, lowest } from "./floor";
import { Frames } from "./frames";
import type { Item } from "./items";
import { type Arrange, Labelling } from "./labelling";
import { LazyDrop } from "./lazyDrop";
import { LazyGizmo } from "./lazyGizmo";
import { LazyPath } from "./lazyPath";
import { light } from "./light";
import { DARK, LIGHT, type Palette } from "./palette";
import { ParentLines } from "./parentLines";
import type { StraightPath } from "./pathLine";
import { type Hit, onFloor, pick } from "./picking";
import { followPointer } from "./pointer";
import { type Probe, probe } from "./probe";
import { type Renderer, rendererOf } from "./renderer";
import { Resolution } from "./resolution";
import type { LowQuality, Quality } from "./surface";
import type { Context, Thing } from "./thing";
import { make } from "./things/make";
import { type JointLimit, RobotThing } from "./things/robot";

export type { Quality };

interface EngineOptions {
  canvas: HTMLCanvasElement;
  labels: HTMLElement;
  telemetry: Telemetry;
  asset: Context["asset"];
  reportFault: Context["reportFault"];
  /** The module that draws at low quality; null at high quality. */
  low: LowQuality | null;
  dark: boolean;
}

const SMALL: ReadonlySet<Item["kind"]> = new Set(["point", "orientation", "action", "logic"]);
/** Time between two frames, s. */
const PERIODS: Record<Quality, number> = { low: 1 / 30, high: 1 / 60 };

export class Engine {
  readonly view: View;
  readonly scene = new Scene();
  /** The gizmo of the transform tool: moves, turns and resizes an item. */
  readonly gizmo: LazyGizmo;
  /** Number of drawn frames. */
  frames = 0;
  onTap: (hits: Hit[], floor: Vector3 | null) => void = () => {};

  /** Draws the items: on the canvas, or for each eye of a headset. */
  output = (scene: Scene, camera: Camera): void => this.renderer.render(scene, camera);
  private readonly watchers = new Set<() => void>();
  readonly renderer: Renderer;
  private readonly things = new Map<string, Thing>();
  private readonly batches: Batches;
  private readonly labelling: Labelling;
  private readonly context: Context;
  private readonly floorGrid: Floor;
  private readonly animation: Animation;
  private palette: Palette = LIGHT;
  readonly requests: Frames;
  private readonly resolution: Resolution;
  /** Frames of items may have changed since the last frame. */
  private dirty = true;
  /** Robots whose joints changed since the last frame. */
  private readonly movedRobots = new Set<RobotThing>();
  private width = 1;
  private height = 1;
  private readonly fitting: Fitting;
  private readonly drop: LazyDrop;
  /** Lines from points to their parents. */
  readonly parentLines: ParentLines;
  private readonly pathLine: LazyPath;
  private readonly cleanups: (() => void)[] = [];

  constructor(private readonly options: EngineOptions) {
    const { canvas, low } = options;
    const quality: Quality = low ? "low" : "high";
    this.renderer = rendererOf(canvas, quality);
    this.resolution = new Resolution(
      quality === "low",
      (width, height) => this.renderer.setSize(width, height, false),
      () => this.draw(),
    );
    this.requests = new Frames(PERIODS[quality], quality === "low", (seconds) => this.frame(seconds));
    this.view = new View(canvas, () => this.draw());
    this.fitting = new Fitting(this.view, this.things);
    this.batches = new Batches(this.scene, low, () => this.draw());
    this.labelling = new Labelling(options.labels, () => this.draw());
    this.animation = new Animation(
      quality,
      () => this.draw(),
      () => this.invalidate(),
    );
    this.context = {
      telemetry: options.telemetry,
      palette: this.palette,
      batches: this.batches,
      quality,
      low,
      period: PERIODS[quality],
      asset: options.asset,
      reportFault: options.reportFault,
      thing: (id) => this.things.get(id),
      metresPerPixel: (at) =>
        (2 * this.view.camera.position.distanceTo(at) * Math.tan((this.view.camera.fov * Math.PI) / 360)) / this.height,
      invalidate: () => this.invalidate(),
      loaded: (id) => this.loaded(id),
      animate: (thing) => this.animation.add(thing),
    };
    this.drop = new LazyDrop(this.scene, () => this.draw());
    this.parentLines = new ParentLines(this.scene);
    this.pathLine = new LazyPath(this.scene, () => this.draw());
    this.gizmo = new LazyGizmo({
      canvas,
      scene: this.scene,
      camera: () => this.view.camera,
      size: () => ({ width: this.width, height: this.height }),
      draw: () => this.draw(),
    });
    this.cleanups.push(light(this.scene));
    this.floorGrid = new Floor(this.scene, quality === "high");
    this.setDark(options.dark);
    this.floorGrid.addNumbers(() => this.draw()).catch(() => {});
    this.cleanups.push(options.telemetry.subscribe((id) => this.reported(id)));
    this.cleanups.push(checkAges(this.things, () => this.invalidate()));
    const watch = new ResizeObserver(() => this.resize());
    watch.observe(canvas.parentElement ?? canvas);
    this.cleanups.push(() => watch.disconnect());
    this.cleanups.push(
      followPointer(canvas, {
        onTap: (x, y, slack) => this.onTap(this.pick(x, y, slack), this.floor(x, y)),
        onHover: (x, y) => this.hover(this.pick(x, y, 4)[0]?.id ?? ""),
      }),
    );
    this.resize();
  }

  /** Show these items and no others. An item that is the same object as before is not updated. */
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
        this.fitting.added(item);
      }
      thing.update(item);
    }
    for (const [id, thing] of [...this.things]) {
      if (wanted.has(id)) continue;
      this.remove(id, thing);
      changed = true;
    }
    if (!changed) return;
    for (const thing of this.things.values()) this.attachToParent(thing);
    this.invalidate();
  }

  /** Show a text next to the name of an item; an empty text removes it. */
  note(id: string, text: string): void {
    this.labelling.moved = { id: text ? id : "", text };
    this.draw();
  }

  /** Show the straight path of the tool instead of the previous one; null hides it. */
  showPath(path: StraightPath | null): void {
    void this.pathLine.show(path, this.palette);
  }

  get straightPath(): StraightPath | null {
    return this.pathLine.shown;
  }

  /** Show the label of the item under the pointer. */
  hover(id: string): void {
    if (id === this.labelling.hovered) return;
    this.labelling.hovered = id;
    this.draw();
  }

  setDark(dark: boolean): void {
    this.palette = dark ? DARK : LIGHT;
    this.context.palette = this.palette;
    this.scene.background = this.palette.background;
    this.scene.fog = new Fog(this.palette.background, 4, 13);
    this.floorGrid.paint(this.palette);
    for (const thing of this.things.values()) thing.update(thing.item);
    this.invalidate();
  }

  /** Return the items at a position in the view, pixels, best first; or as another camera shows them. */
  pick(x: number, y: number, slack = 12, camera: Camera = this.view.camera): Hit[] {
    this.place();
    const roots = this.scene.children.filter((each) => !each.userData.ground);
    return pick(x, y, { width: this.width, height: this.height }, camera, roots, slack, (id) => {
      const kind = this.things.get(id)?.item.kind;
      return kind !== undefined && SMALL.has(kind);
    });
  }

  /** Return the shown items as drawn, and the size of the view, pixels: for overlays. */
  shown(): { things: ReadonlyMap<string, Thing>; width: number; height: number } {
    this.place();
    return { things: this.things, width: this.width, height: this.height };
  }

  /** Call a function after each frame; return a function that unsubscribes it. */
  watch(watcher: () => void): () => void {
    this.watchers.add(watcher);
    return () => this.watchers.delete(watcher);
  }

  /** Set the function that selects the labels and reserves places. A frame is drawn only if the scene changed. */
  arrangeBy(arrange: Arrange): void {
    this.labelling.arrange = arrange;
    const { things, view, width, height } = this;
    if (!this.requests.pending && this.labelling.place(things, view.camera, width, height)) this.draw();
  }

  /** Return the point on the floor, or on a level above it, m, at a position in the view. */
  floor(x: number, y: number, level = 0): Vector3 | null {
    return onFloor(x, y, { width: this.width, height: this.height }, this.view.camera, 20, level);
  }

  /** Bring an item, some or all items into the view; `best` chooses the direction too. */
  focus(id?: string | readonly string[], best = false): void {
    this.place();
    this.fitting.focus(id === undefined ? id : [id].flat(), best);
  }

  private loaded(id: string): void {
    this.dirty = true;
    this.place();
    this.fitting.loaded(id);
    this.invalidate();
  }

  item(id: string): Probe | undefined {
    const thing = this.things.get(id);
    if (!thing) return undefined;
    this.place();
    return probe(thing, this.context.telemetry, this.view.camera, { width: this.width, height: this.height });
  }

  /** Return the joints of a robot with their limits; none if its model is missing or not loaded. */
  limits(id: string): JointLimit[] {
    const thing = this.things.get(id);
    return thing instanceof RobotThing ? thing.limits() : [];
  }

  ids(): string[] {
    return [...this.things.keys()];
  }

  /** Draw a frame after a change. */
  invalidate(): void {
    this.dirty = true;
    this.draw();
  }

  /** Return a picture of the view. */
  async picture(type = "image/webp"): Promise<Blob | null> {
    this.resolution.full();
    this.render();
    return new Promise((resolve) => this.options.canvas.toBlob(resolve, type, 0.8));
  }

  dispose(): void {
    for (const cleanUp of this.cleanups) cleanUp();
    this.requests.dispose();
    this.resolution.dispose();
    for (const [id, thing] of [...this.things]) this.remove(id, thing);
    this.batches.dispose();
    this.labelling.dispose();
    this.gizmo.dispose();
    this.drop.dispose();
    this.parentLines.dispose();
    this.pathLine.dispose();
    this.floorGrid.dispose();
    this.view.dispose();
    this.renderer.dispose();
  }

  private remove(id: string, thing: Thing): void {
    if (thing instanceof RobotThing) this.movedRobots.delete(thing);
    this.animation.remove(thing);
    // Children get another frame by `attachToParent`, or are removed themselves.
    for (const other of this.things.values()) if (other.root.parent === thing.root) other.root.removeFromParent();
    thing.dispose();
    this.things.delete(id);
  }

  /** Put an item into the frame of its parent. */
  private attachToParent(thing: Thing): void {
    const { parent } = thing.item as { parent?: string };
    const frame = (parent !== undefined && this.things.get(parent)?.root) || this.scene;
    if (thing.root.parent !== frame) frame.add(thing.root);
  }

  private reported(id: string): void {
    const thing = this.things.get(id);
    if (!(thing instanceof RobotThing) || !thing.moved()) return;
    this.movedRobots.add(thing);
    this.draw();
  }

  private resize(): void {
    const host = this.options.canvas.parentElement ?? this.options.canvas;
    const [width, height] = [Math.max(1, host.clientWidth), Math.max(1, host.clientHeight)];
    if (width === this.width && height === this.height) return;
    [this.width, this.height] = [width, height];
    this.resolution.resize(this.width, this.height);
    this.batches.links.height = this.height;
    this.view.resize(this.width, this.height);
    if (this.view.resizedSinceFit) {
      this.place();
      this.fitting.refit();
    }
    this.draw();
  }

  /** Whether a frame is requested, for tests. */
  get scheduled(): number {
    return this.requests.pending || Number(this.resolution.moving);
  }

  private draw(): void {
    this.requests.request();
  }

  /** Draw a frame; return whether another one is needed. */
  private frame(seconds: number): boolean {
    const flying = this.view.fly(seconds);
    const moving = this.animation.step(seconds);
    if (moving) this.renderer.shadowMap.needsUpdate = true;
    this.render();
    for (const watcher of this.watchers) watcher();
    return flying || moving;
  }

  /** Update the frames of all items after a change of an item, otherwise only those of robots that moved. */
  private place(): void {
    const movedRobots = [...this.movedRobots];
    this.movedRobots.clear();
    if (!this.dirty) {
      for (const robot of movedRobots) {
        if (robot.frame()) this.movedRobots.add(robot);
        robot.root.updateMatrixWorld();
        this.renderer.shadowMap.needsUpdate = true;
      }
      return;
    }
    this.dirty = false;
    this.scene.updateMatrixWorld();
    for (const thing of this.things.values())
      if (thing instanceof RobotThing && thing.frame()) this.movedRobots.add(thing);
    this.scene.updateMatrixWorld();
    for (const thing of this.things.values()) if (thing.item.kind !== "logic") thing.placed();
    for (const thing of this.things.values()) if (thing.item.kind === "logic") thing.placed();
    this.scene.updateMatrixWorld();
    this.batches.refresh();
    this.floorGrid.lower(lowest(this.things.values()));
    this.parentLines.show(this.things, this.palette);
    this.renderer.shadowMap.needsUpdate = true;
  }

  private render(): void {
    const { camera } = this.view;
    camera.updateMatrixWorld();
    if (!this.requests.driven) this.resolution.follow(camera);
    // Sizes on the screen are adjusted when the camera has stopped: placing hundreds of items takes most of a frame.
    if (!this.resolution.moving) for (const thing of this.things.values()) if (thing.resized()) this.dirty = true;
    this.place();
    this.gizmo.place();
    this.drop.update(this.things.values(), this.palette, this.labelling.notes);
    this.labelling.place(this.things, camera, this.width, this.height);
    this.output(this.scene, camera);
    this.frames++;
    if (this.movedRobots.size > 0) this.draw();
  }
}
