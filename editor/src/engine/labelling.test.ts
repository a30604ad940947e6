import { Vector3 } from "three";
import { expect, test } from "vitest";
import type { Item } from "./items";
import { labelsOf } from "./labelling";
import type { Thing } from "./thing";

const thing = (id: string, item: object, badge = ""): [string, Thing] => [
  id,
  {
    item: { id, name: id, selected: false, faint: 0, ...item } as Item,
    badge: () => badge,
    anchor: (target: Vector3) => target.set(0, 0, 0),
  } as unknown as Thing,
];
const action = { kind: "action", open: true, count: 1, level: 0, role: "action" };
const things = new Map([
  thing("robot", { kind: "robot" }),
  thing("table", { kind: "object" }),
  thing("belt", { kind: "object", selected: true }),
  thing("tester", { kind: "object" }, "in use by Eva"),
  thing("near", { kind: "point" }),
  thing("start", { ...action, role: "start" }),
  thing("runs", { ...action, running: true }),
  thing("waits", action),
]);
const shown = (width: number, hovered = "") =>
  labelsOf(things, hovered, new Map(), new Vector3(0, 0, 0.5), width)
    .sort((a, b) => b.weight - a.weight)
    .map(({ id }) => id);

test("on a phone only what is selected, runs or needs attention, and robots have a label; the rest on tap", () => {
  expect(shown(1280)).toHaveLength(8);
  expect(shown(390)).toEqual(["belt", "tester", "robot", "runs"]);
  expect(shown(390, "near")).toEqual(["belt", "near", "tester", "robot", "runs"]);
});
