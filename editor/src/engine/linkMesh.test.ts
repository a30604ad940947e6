import { Scene, Vector3 } from "three";
import { expect, it } from "vitest";
import { type Line, LinkMesh } from "./linkMesh";

const line = (color: string, ...at: number[]): Line => {
  const x = new Vector3(1, 0, 0);
  const strip = { places: at.map((each) => new Vector3(each)), directions: at.map(() => x) };
  return { color, arrow: { strips: [strip], head: [new Vector3(), x] } };
};

it("all lines are one geometry with their colours", () => {
  const links = new LinkMesh(new Scene());
  links.show([line("ff0000", 0, 1, 2), line("0000ff", 0, 1)]);
  const color = links.mesh.geometry.getAttribute("color");
  // Two corners per point, three of the head; two triangles per section, one of the head.
  expect([links.mesh.geometry.getAttribute("position").count, color.getX(8), color.getZ(9)]).toEqual([9 + 7, 1, 1]);
  expect([...(links.mesh.geometry.index?.array ?? [])].slice(15)).toEqual([9, 10, 11, 11, 10, 12, 13, 14, 15]);
  links.show([]);
  expect(links.mesh.visible).toBe(false);
});
