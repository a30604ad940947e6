/** Which items have a label, how important it is, and the text next to the name. */

import { type PerspectiveCamera, Vector3 } from "three";
import type { Item } from "./items";
import { type Label, Labels, type Rect } from "./labels";
import type { Thing } from "./thing";
import { LinkThing } from "./things/link";

const WEIGHTS: Record<Item["kind"], number> = {
  robot: 40,
  object: 10,
  point: 20,
  action: 30,
  orientation: 5,
  logic: 0,
};

/** Width of the view below which only the most important items have a label, pixels: on a phone. */
const NARROW = 600;
/** Distance from the camera within which points and actions are labelled, m. */
const NEAR = 0.9;
const place = new Vector3();

/** Returns the labels that are drawn, and places that they leave free, pixels. */
export type Arrange = (labels: Label[]) => [Label[], Rect[]];

/** Places the labels of items on the page, and those of conditions in the scene. */
export class Labelling {
  arrange: Arrange = (labels) => [labels, []];
  /** The item under the pointer. */
  hovered = "";
  /** Texts next to the names of items. */
  readonly notes = new Map<string, string>();
  /** Text shown next to an item while it is moved, instead of its height. */
  moved = { id: "", text: "" };
  private readonly labels: Labels;

  constructor(host: HTMLElement, draw: () => void) {
    this.labels = new Labels(host, draw);
  }

  /** Place all labels; return whether those in the scene changed. */
  place(things: Map<string, Thing>, camera: PerspectiveCamera, width: number, height: number): boolean {
    if (this.moved.id) this.notes.set(this.moved.id, this.moved.text);
    const labels = labelsOf(things, this.hovered, this.notes, camera.position, width);
    this.labels.show(...this.arrange(labels), camera, width, height);
    return placeConditions(things, this.labels, camera, width, height);
  }

  dispose(): void {
    this.labels.dispose();
  }
}

/** Show the labels of conditions that overlap no other label; return whether the visibility of one changed. */
function placeConditions(
  things: Map<string, Thing>,
  labels: Labels,
  camera: PerspectiveCamera,
  width: number,
  height: number,
): boolean {
  let changed = false;
  for (const thing of things.values()) {
    const plate = thing instanceof LinkThing ? thing.plate : null;
    if (!plate) continue;
    const { label, at } = plate;
    const pixels = height / (2 * place.copy(at).distanceTo(camera.position) * Math.tan((camera.fov * Math.PI) / 360));
    place.copy(at).project(camera);
    const [x, y] = [((place.x + 1) / 2) * width, ((1 - place.y) / 2) * height];
    const [w, h] = [(label.scale.x * pixels) / 2, (label.scale.y * pixels) / 2];
    const visible = labels.reserve({ left: x - w, right: x + w, top: y - h, bottom: y + h });
    changed ||= visible !== label.visible;
    label.visible = visible;
  }
  return changed;
}

/**
 * Return the labels with their priorities: selected, under the pointer or crosshair, with a badge, near. In a narrow
 * view, only these, running actions and robots have a label; other items get one when they are tapped.
 */
export function labelsOf(
  things: ReadonlyMap<string, Thing>,
  hovered: string,
  notes: ReadonlyMap<string, string>,
  eye: Vector3,
  width: number,
): Label[] {
  const found: Label[] = [];
  for (const [id, thing] of things) {
    const { item } = thing;
    const badge = thing.badge();
    const note = notes.get(id) ?? "";
    const under = id === hovered;
    if (item.faint >= 1) continue;
    // A stack has one label, with the number of its actions.
    const stack = item.kind === "action" && !item.open && item.count > 1 && !under;
    if (stack && item.level > 0) continue;
    const always =
      stack ||
      item.kind === "robot" ||
      item.kind === "object" ||
      (item.kind === "action" && (item.running || item.role !== "action"));
    const small = item.kind === "point" || item.kind === "action";
    const important = item.selected || under || badge !== "";
    if (width < NARROW && !important && item.kind !== "robot" && !(item.kind === "action" && item.running)) continue;
    if (!always && !small && !important) continue;
    const distance = thing.anchor(place).distanceTo(eye);
    if (!always && !important && distance > NEAR) continue;
    const faded = item.faint > 0.5 ? -30 : 0;
    const weight =
      (item.selected ? 1000 : 0) +
      (under ? 500 : 0) +
      (badge ? 100 : 0) +
      WEIGHTS[item.kind] +
      (item.kind === "action" && item.role !== "action" ? 15 : 0) +
      faded +
      20 / (1 + distance);
    found.push({
      id,
      text: stack ? `${things.get(item.parent ?? "")?.item.name ?? ""} ×${item.count}` : item.name,
      badge,
      note,
      selected: item.selected,
      weight,
      anchor: (target) => thing.anchor(target),
    });
  }
  return found;
}
