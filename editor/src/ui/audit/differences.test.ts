import { describe, expect, it } from "vitest";
import { differences } from "./differences";

describe("differences", () => {
  it("names the changed fields of nested items", () => {
    const before = { name: "feeder", position: { x: 0.1, y: 2 }, tags: ["a", "b"] };
    const after = { name: "feeder", position: { x: 0.2, y: 2 }, tags: ["a"] };
    expect(differences(before, after)).toEqual([
      { field: "position.x", before: "0.1", after: "0.2" },
      { field: "tags.1", before: "b", after: "" },
    ]);
  });

  it("lists the fields of added and removed items", () => {
    expect(differences(null, { name: "feeder" })).toEqual([{ field: "name", before: "", after: "feeder" }]);
    expect(differences({ name: "feeder" }, null)).toEqual([{ field: "name", before: "feeder", after: "" }]);
  });

  it("finds nothing in equal items", () => {
    expect(differences({ a: [1, null] }, { a: [1, undefined] })).toEqual([]);
  });
});
