import { BoxGeometry, Group, Mesh } from "three";
import { expect, it } from "vitest";
import { ownedBy, trianglesOf } from "./thing";

it("triangles are counted of an item's own meshes, also of those that are not built yet", () => {
  const root = new Group().add(new Mesh(new BoxGeometry()), new Mesh());
  ownedBy(root, "one");
  const other = new Mesh(new BoxGeometry());
  ownedBy(other, "two");
  expect(trianglesOf(root.add(other), "one")).toBe(12);
});
