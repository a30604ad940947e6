/** Labels in the view: a few elements above the canvas, most important first, without overlaps. */

import type { PerspectiveCamera } from "three";
import { Vector3 } from "three";

/** Largest number of labels. */
const MAX_LABELS = 8;
/** Largest number of candidates; in crowded views most do not fit. */
const MAX_TRIED = 24;
/** Distance between two labels, pixels. */
const GAP = 3;

export interface Rect {
  left: number;
  top: number;
  right: number;
  bottom: number;
}

export interface Label {
  id: string;
  text: string;
  badge: string;
  /** Height of the item, or its current change. */
  note: string;
  selected: boolean;
  /** Higher priorities come first. */
  weight: number;
  anchor: (target: Vector3) => Vector3;
}

const at = new Vector3();

export class Labels {
  private readonly elements = new Map<string, HTMLElement>();
  private placed: Rect[] = [];

  private readonly sizes: ResizeObserver;

  /** `draw` requests a new frame: the size of labels changes with the font and the text size of the page. */
  constructor(
    private readonly host: HTMLElement,
    draw: () => void,
  ) {
    this.sizes = new ResizeObserver(draw);
  }

  /** Move the labels to the items as drawn; leave the `taken` places free. */
  show(labels: Label[], taken: Rect[], camera: PerspectiveCamera, width: number, height: number): void {
    const placed = [...taken];
    this.placed = placed;
    const tried = new Set<string>();
    // Moved after all sizes were read: each read after a change lays the page out again.
    const boxes = new Map<HTMLElement, Rect | undefined>();
    const wanted = [...labels].sort((a, b) => b.weight - a.weight);
    for (const label of wanted) {
      if (placed.length >= MAX_LABELS + taken.length || tried.size >= MAX_TRIED) break;
      label.anchor(at).project(camera);
      if (at.z > 1 || Math.abs(at.x) > 1 || Math.abs(at.y) > 1) continue;
      const x = ((at.x + 1) / 2) * width;
      const y = ((1 - at.y) / 2) * height;
      tried.add(label.id);
      const element = this.element(label);
      const [half, tall] = [element.offsetWidth / 2, element.offsetHeight];
      // Keep the label inside the view.
      const centre = Math.min(Math.max(x, half + 4), Math.max(half + 4, width - half - 4));
      // Above the item if possible, otherwise below it.
      const box = [y - tall - 8, y + 12]
        .map((edge) => Math.max(4, edge))
        .map((top) => ({ left: centre - half, right: centre + half, top, bottom: top + tall }))
        .find((each) => !placed.some((other) => overlap(each, other)));
      boxes.set(element, box);
      if (box) placed.push(box);
    }
    for (const [{ style }, box] of boxes) {
      style.visibility = box ? "visible" : "hidden";
      if (box) style.transform = `translate(${Math.round(box.left)}px, ${Math.round(box.top)}px)`;
    }
    for (const [id, element] of this.elements) {
      if (tried.has(id)) continue;
      this.sizes.unobserve(element);
      element.remove();
      this.elements.delete(id);
    }
  }

  /** Reserve a rectangle of the view, pixels; return whether it overlaps no other one. */
  reserve(box: Rect): boolean {
    if (this.placed.some((other) => overlap(box, other))) return false;
    this.placed.push(box);
    return true;
  }

  dispose(): void {
    this.sizes.disconnect();
    for (const element of this.elements.values()) element.remove();
    this.elements.clear();
  }

  private element(label: Label): HTMLElement {
    let element = this.elements.get(label.id);
    if (!element) {
      element = document.createElement("div");
      element.className = "view-label";
      element.append(document.createElement("span"), document.createElement("small"), document.createElement("em"));
      this.elements.set(label.id, element);
      this.host.append(element);
      this.sizes.observe(element);
    }
    const [name, badge, note] = element.children as unknown as [HTMLElement, HTMLElement, HTMLElement];
    if (name.textContent !== label.text) name.textContent = label.text;
    if (badge.textContent !== label.badge) badge.textContent = label.badge;
    badge.hidden = !label.badge;
    if (note.textContent !== label.note) note.textContent = label.note;
    note.hidden = !label.note;
    const selected = String(label.selected);
    if (element.dataset.selected !== selected) element.dataset.selected = selected;
    return element;
  }
}

function overlap(a: Rect, b: Rect): boolean {
  return a.left < b.right + GAP && b.left < a.right + GAP && a.top < b.bottom + GAP && b.top < a.bottom + GAP;
}
