import { BoxGeometry, Color, Scene } from "three";
import { expect, it } from "vitest";
import { LinkLines } from "./linkLines";

it("all lines are one geometry with their colours, rebuilt only after a change", () => {
  const lines = new LinkLines(new Scene());
  const [one, two] = [new BoxGeometry(), new BoxGeometry()];
  lines.set("a", one, new Color(1, 0, 0));
  lines.set("b", two, new Color(0, 0, 1));
  lines.refresh();
  const first = lines.mesh.geometry;
  const count = one.getAttribute("position").count;
  const color = first.getAttribute("color");
  expect([first.getAttribute("position").count, color.getX(0), color.getZ(count)]).toEqual([2 * count, 1, 1]);
  expect([...(first.index?.array ?? [])].slice(36)).toEqual([...(two.index?.array ?? [])].map((each) => each + count));
  lines.set("a", one, new Color(1, 0, 0));
  lines.refresh();
  expect(lines.mesh.geometry).toBe(first);
  lines.set("a", null, new Color());
  lines.refresh();
  expect(lines.mesh.geometry.getAttribute("position").count).toBe(count);
  lines.set("b", null, new Color());
  lines.refresh();
  expect(lines.mesh.visible).toBe(false);
});
