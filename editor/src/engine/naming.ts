/** Which things have their name in the view, how important each is, and what stands beside it. */

import type { Item } from "./items";
import type { Label } from "./labels";
import type { Thing } from "./thing";

const WEIGHTS: Record<Item["kind"], number> = { robot: 40, object: 10, point: 20, action: 30, orientation: 5, logic: 0 };

export function labelsOf(things: Map<string, Thing>, hovered: string, notes: ReadonlyMap<string, string>): Label[] {
  const found: Label[] = [];
  for (const [id, thing] of things) {
    const { item } = thing;
    const badge = thing.badge();
    const note = notes.get(id) ?? "";
    const under = id === hovered;
    const named = item.kind === "robot" || (item.kind === "action" && (item.running || item.role !== "action"));
    if (item.faint >= 1 || !(item.selected || under || badge || named || item.kind === "object")) continue;
    const weight = (item.selected ? 1000 : 0) + (under ? 500 : 0) + (badge ? 100 : 0) + WEIGHTS[item.kind];
    found.push({ id, text: item.name, badge, note, selected: item.selected, weight, anchor: (target) => thing.anchor(target) });
  }
  return found;
}
