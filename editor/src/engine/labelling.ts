/** Which items have a label, how important it is, and the text next to the name. */

import { Vector3 } from "three";
import type { Item } from "./items";
import type { Label } from "./labels";
import type { Thing } from "./thing";

const WEIGHTS: Record<Item["kind"], number> = {
  robot: 40,
  object: 10,
  point: 20,
  action: 30,
  orientation: 5,
  logic: 0,
};

/** Distance from the camera within which points and actions are labelled, m. */
const NEAR = 0.9;
const place = new Vector3();

/** Priority: selected, under the pointer or crosshair, with a badge, near. */
export function labelsOf(
  things: Map<string, Thing>,
  hovered: string,
  notes: ReadonlyMap<string, string>,
  eye: Vector3,
): Label[] {
  const found: Label[] = [];
  for (const [id, thing] of things) {
    const { item } = thing;
    const badge = thing.badge();
    const note = notes.get(id) ?? "";
    const under = id === hovered;
    if (item.faint >= 1) continue;
    const always =
      item.kind === "robot" ||
      item.kind === "object" ||
      (item.kind === "action" && (item.running || item.role !== "action"));
    const small = item.kind === "point" || item.kind === "action";
    const important = item.selected || under || badge !== "";
    if (!always && !small && !important) continue;
    const distance = thing.anchor(place).distanceTo(eye);
    if (!always && !important && distance > NEAR) continue;
    const faded = item.faint > 0.5 ? -30 : 0;
    const weight =
      (item.selected ? 1000 : 0) +
      (under ? 500 : 0) +
      (badge ? 100 : 0) +
      WEIGHTS[item.kind] +
      faded +
      20 / (1 + distance);
    found.push({
      id,
      text: item.name,
      badge,
      note,
      selected: item.selected,
      weight,
      anchor: (target) => thing.anchor(target),
    });
  }
  return found;
}
