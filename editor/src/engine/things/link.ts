/** A connection of the program: an arc between two pucks, with colour, dashes and label by branch. */

import {
  type BufferGeometry,
  CanvasTexture,
  Color,
  ConeGeometry,
  Group,
  LinearFilter,
  Mesh,
  MeshBasicMaterial,
  QuadraticBezierCurve3,
  Quaternion,
  Sprite,
  SpriteMaterial,
  SRGBColorSpace,
  TubeGeometry,
  Vector3,
} from "three";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import type { LinkItem } from "../items";
import { type Context, ownedBy, Thing } from "../thing";

/** Thickness of lines, half, pixels, and its limits, m; in steps, since lines are rebuilt with each. */
const HALF = 1.1;
const THINNEST = 0.0006;
const THICKEST = 0.006;
/** Part of the background in the colour of pale lines, and opacity of their conditions. */
const PALE = 0.75;
const DIM = 0.25;
/** Layer of what is picked but drawn by `LinkLines`. */
export const PICKED = 1;
/** Lengths of dash and gap, m; empty: solid. */
const DASHES: Record<LinkItem["branch"], [number, number] | null> = {
  always: null,
  true: [0.05, 0.014],
  false: [0.014, 0.014],
  value: [0.03, 0.02],
};
const Z = new Vector3(0, 1, 0);
/** Height of the label, m, and its limits on the screen, pixels. */
const PLATE = 0.036;
const LEAST = 14;
const MOST = 30;

export class LinkThing extends Thing<LinkItem> {
  readonly root = new Group();
  item: LinkItem;
  private readonly color = new Color();
  private readonly line = new Mesh(undefined, new MeshBasicMaterial());
  private label: Sprite | null = null;
  private labelled = "";
  private drawn = "";
  private readonly from = new Vector3();
  private readonly to = new Vector3();
  private readonly middle = new Vector3();
  private radius = 0.002;

  constructor(item: LinkItem, context: Context) {
    super(context);
    this.item = item;
    this.line.layers.set(PICKED);
    this.root.add(this.line);
    ownedBy(this.root, item.id);
  }

  update(item: LinkItem): void {
    this.item = item;
    const { palette } = this.context;
    const color = item.selected ? palette.selected : palette.link[item.branch];
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
    const drawn =
      [...this.from.toArray(), ...this.to.toArray()].map((one) => one.toFixed(4)).join() +
      this.item.branch +
      this.radius;
    if (drawn !== this.drawn) {
      this.drawn = drawn;
      this.line.geometry.dispose();
      this.line.geometry = this.bow();
      this.label?.position.copy(this.middle);
    }
    this.context.batches.links.set(this.item.id, this.line.geometry, this.color);
  }

  override resized(): boolean {
    if (!this.root.visible) return false;
    const pixel = this.context.metresPerPixel(this.middle);
    const wanted = Math.min(THICKEST, Math.max(THINNEST, 2 ** (Math.round(Math.log2(HALF * pixel) * 2) / 2)));
    const changed = wanted !== this.radius;
    this.radius = wanted;
    if (!this.label) return changed;
    const height = Math.min(MOST * pixel, Math.max(LEAST * pixel, PLATE));
    this.label.scale.multiplyScalar(height / this.label.scale.y).setZ(1);
    return changed;
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

  private bow(): BufferGeometry {
    const length = Math.max(1e-3, this.from.distanceTo(this.to));
    const control = new Vector3().addVectors(this.from, this.to).multiplyScalar(0.5);
    control.z += Math.min(0.25, 0.03 + length * 0.3);
    const [around, along] = this.context.quality === "low" ? [3, 8] : [5, 14];
    const curve = new QuadraticBezierCurve3(this.from.clone(), control, this.to.clone());
    curve.getPoint(0.5, this.middle);
    const pieces: BufferGeometry[] = [];
    const dash = DASHES[this.item.branch];
    const full = curve.getLength();
    if (!dash) pieces.push(new TubeGeometry(curve, along, this.radius, around));
    else {
      const [on, off] = dash;
      const most = Math.max(on + off, full / 40); // long lines have longer dashes, not more of them
      for (let at = 0; at < full; at += most) {
        const from = at / full;
        const to = Math.min(1, (at + (most * on) / (on + off)) / full);
        const part = new QuadraticBezierCurve3(...subdivided(curve, from, to));
        pieces.push(new TubeGeometry(part, 3, this.radius, around));
      }
    }
    const head = new ConeGeometry(this.radius * 3.6, this.radius * 11, around + 1);
    head.applyQuaternion(new Quaternion().setFromUnitVectors(Z, curve.getTangentAt(0.86)));
    const at = curve.getPointAt(0.86);
    pieces.push(head.translate(at.x, at.y, at.z));
    const whole = mergeGeometries(pieces);
    for (const piece of pieces) piece.dispose();
    return whole;
  }
}

/** A section of a quadratic curve is a quadratic curve. */
function subdivided(curve: QuadraticBezierCurve3, a: number, b: number): [Vector3, Vector3, Vector3] {
  const start = curve.getPoint(a);
  const end = curve.getPoint(b);
  const tangent = new Vector3().subVectors(curve.v1, curve.v0).lerp(new Vector3().subVectors(curve.v2, curve.v1), a);
  return [start, start.clone().addScaledVector(tangent, b - a), end];
}

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
