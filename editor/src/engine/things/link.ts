/** A connection of the program: an arc between two pucks, with colour, dashes and label by branch. */

import {
  BufferGeometry,
  CanvasTexture,
  Color,
  Group,
  type Intersection,
  LinearFilter,
  Mesh,
  type Raycaster,
  Sprite,
  SpriteMaterial,
  SRGBColorSpace,
  Vector3,
} from "three";
import type { LinkItem } from "../items";
import type { Arrow, Strip } from "../linkMesh";
import { type Context, ownedBy, Thing } from "../thing";

/** Distance within which a line is hit, pixels. */
const HIT = 3;
/** Sections of a line, by quality, and of a dash. */
const SECTIONS = { low: 5, high: 16 };
const DASHED = 2;
/** Part of the background in the colour of pale lines, and opacity of their conditions. */
const PALE = 0.75;
const DIM = 0.25;
/** Layer of what is picked but drawn by `LinkLines`. */
const PICKED = 1;
/** Lengths of dashes, each followed by its gap, m; null: solid. */
const DASHES: Record<LinkItem["branch"], number[] | null> = {
  always: null,
  true: [0.05, 0.014],
  false: [0.014, 0.014],
  value: [0.03, 0.02],
  error: [0.045, 0.012, 0.008, 0.012],
};
/** Sideways bend of error exits, as a part of their length, and at most, m: a step may have the same ends. */
const ASIDE = [0.2, 0.1] as const;
/** The position of the arrowhead, as a fraction of the line. */
const HEAD = 0.86;
/** Height of the label, m, and its limits on the screen, pixels. */
const PLATE = 0.036;
const LEAST = 14;
const MOST = 30;

export class LinkThing extends Thing<LinkItem> {
  readonly root = new Group();
  item: LinkItem;
  private readonly color = new Color();
  /** The points of the line, used for picking only. */
  private readonly line = new Mesh();
  private arrow: Arrow | null = null;
  private label: Sprite | null = null;
  private labelled = "";
  private drawn = "";
  private readonly from = new Vector3();
  private readonly to = new Vector3();
  private readonly middle = new Vector3();

  constructor(item: LinkItem, context: Context) {
    super(context);
    this.item = item;
    this.line.layers.set(PICKED);
    this.line.raycast = (caster, hits) => this.hit(caster, hits);
    this.root.add(this.line);
    ownedBy(this.root, item.id);
  }

  update(item: LinkItem): void {
    this.item = item;
    const { palette } = this.context;
    const color = item.selected ? palette.selected : item.taken ? palette.running : palette.link[item.branch];
    this.color.copy(color);
    if (item.dim) this.color.lerp(palette.background, PALE);
    if (this.label) this.label.material.opacity = item.dim ? DIM : 1;
    const label = `${item.condition}#${color.getHexString()}`;
    if (label !== this.labelled) {
      this.labelled = label;
      this.label?.material.map?.dispose();
      this.label?.material.dispose();
      this.label?.removeFromParent();
      this.label = item.condition
        ? text(item.condition, `#${color.getHexString()}`, `#${palette.background.getHexString()}`)
        : null;
      if (this.label) {
        this.label.userData.item = item.id;
        this.root.add(this.label);
        this.drawn = "";
      }
    }
  }

  override placed(): void {
    const { from, to } = this.item;
    const start = this.context.thing(from);
    const end = this.context.thing(to);
    this.root.visible = start !== undefined && end !== undefined && this.item.faint < 1 && !this.item.inside;
    if (!start || !end || !this.root.visible) return this.context.batches.links.set(this.item.id, null, this.color);
    start.anchor(this.from);
    end.anchor(this.to);
    const drawn = [...this.from.toArray(), ...this.to.toArray()].map((one) => one.toFixed(4)).join() + this.item.branch;
    if (drawn !== this.drawn) {
      this.drawn = drawn;
      this.buildArc();
      this.label?.position.copy(this.middle);
    }
    this.context.batches.links.set(this.item.id, this.arrow, this.color);
  }

  override resized(): boolean {
    if (!this.root.visible || !this.label) return false;
    const pixel = this.context.metresPerPixel(this.middle);
    const height = Math.min(MOST * pixel, Math.max(LEAST * pixel, PLATE));
    this.label.scale.multiplyScalar(height / this.label.scale.y).setZ(1);
    return false;
  }

  override anchor(target: Vector3): Vector3 {
    return target.copy(this.middle);
  }

  override dispose(): void {
    this.context.batches.links.set(this.item.id, null, this.color);
    this.label?.material.map?.dispose();
    super.dispose();
  }

  /** The label of its condition with its height, m; null without one. */
  get plate(): { label: Sprite; at: Vector3 } | null {
    return this.label && this.root.visible ? { label: this.label, at: this.middle } : null;
  }

  /** Report a hit where the ray passes the line closely. */
  private hit(caster: Raycaster, hits: Intersection[]): void {
    const points = this.arrow?.strips.flatMap(({ places }) => places) ?? [];
    for (let n = 1; n < points.length; n++) {
      const [a, b] = [points[n - 1], points[n]] as [Vector3, Vector3];
      const off = caster.ray.distanceSqToSegment(a, b, onRay, onLine);
      if (off > (HIT * this.context.metresPerPixel(onLine)) ** 2) continue;
      const distance = caster.ray.origin.distanceTo(onLine);
      hits.push({ distance, point: onLine.clone(), object: this.line });
    }
  }

  private buildArc(): void {
    const { from, to } = this;
    const length = Math.max(1e-3, from.distanceTo(to));
    const top = new Vector3().addVectors(from, to).multiplyScalar(0.5);
    top.z += Math.min(0.25, 0.03 + length * 0.3);
    if (this.item.branch === "error") {
      const aside = new Vector3(to.y - from.y, from.x - to.x, 0).normalize();
      top.addScaledVector(aside, 2 * Math.min(ASIDE[1], ASIDE[0] * length)); // the middle is half as far away
    }
    // A quadratic curve and its directions.
    const place = (t: number) => new Vector3().lerpVectors(from, top, t).lerp(new Vector3().lerpVectors(top, to, t), t);
    const direction = (t: number) =>
      new Vector3().subVectors(top, from).lerp(new Vector3().subVectors(to, top), t).normalize();
    const strip = (start: number, end: number, sections: number): Strip => {
      const at = [...Array(sections + 1).keys()].map((n) => start + ((end - start) * n) / sections);
      return { places: at.map(place), directions: at.map(direction) };
    };
    this.middle.copy(place(0.5));
    const strips: Strip[] = [];
    const dash = DASHES[this.item.branch];
    if (!dash) strips.push(strip(0, 1, SECTIONS[this.context.quality]));
    else {
      const full = from.distanceTo(this.middle) + this.middle.distanceTo(to);
      const period = dash.reduce((sum, each) => sum + each);
      const scale = Math.max(1, full / 40 / period); // long lines have longer dashes, not more of them
      for (let at = 0, n = 0; at < full; n += 2) {
        const [on, off] = [n, n + 1].map((each) => scale * (dash[each % dash.length] as number)) as [number, number];
        strips.push(strip(at / full, Math.min(1, (at + on) / full), DASHED));
        at += on + off;
      }
    }
    this.arrow = { strips, head: [place(HEAD), direction(HEAD)] };
    this.line.geometry.dispose();
    this.line.geometry = new BufferGeometry().setFromPoints(strips.flatMap(({ places }) => places));
  }
}

const onRay = new Vector3();
const onLine = new Vector3();

/** A label that always faces the camera. */
function text(word: string, ink: string, plate: string): Sprite {
  const canvas = document.createElement("canvas");
  const pen = canvas.getContext("2d") as CanvasRenderingContext2D;
  const font = "600 40px system-ui, sans-serif";
  pen.font = font;
  canvas.width = Math.ceil(Math.min(600, pen.measureText(word).width)) + 40;
  canvas.height = 64;
  pen.fillStyle = plate;
  pen.beginPath();
  pen.roundRect(0, 0, canvas.width, canvas.height, 20);
  pen.fill();
  pen.lineWidth = 4;
  pen.strokeStyle = ink;
  pen.stroke();
  pen.fillStyle = ink;
  pen.font = font;
  pen.textBaseline = "middle";
  pen.fillText(word, 20, 34, 600);
  const map = new CanvasTexture(canvas);
  map.minFilter = LinearFilter;
  map.colorSpace = SRGBColorSpace;
  const sprite = new Sprite(new SpriteMaterial({ map, depthTest: false, transparent: true }));
  sprite.scale.set((canvas.width / canvas.height) * PLATE, PLATE, 1);
  sprite.renderOrder = 5;
  return sprite;
}
