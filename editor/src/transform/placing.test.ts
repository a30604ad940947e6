import { describe, expect, it } from "vitest";
import { composed, ORIGIN, relativeTo, turn } from "../viewmodel/frames";
import {
  angles,
  carried,
  fromAngles,
  moved,
  onGrid,
  placedAt,
  poseFrom,
  poseText,
  same,
  squared,
  turned,
  turnedTo,
  unit,
} from "./placing";

const POSE = { position: { x: 0.3, y: -0.2, z: 0.15 }, orientation: fromAngles({ x: 0.2, y: -0.4, z: 1.1 }) };
const FRAME = { position: { x: 1, y: 2, z: 0.5 }, orientation: fromAngles({ x: 0, y: 0, z: Math.PI / 2 }) };

describe("moving", () => {
  it("is along the axes of the frame", () => {
    const to = moved(POSE, FRAME, "x", 0.1);
    expect(to.position.x).toBeCloseTo(0.3, 12);
    expect(to.position.y).toBeCloseTo(-0.1, 12);
    expect(to.orientation).toEqual(POSE.orientation);
  });

  it("sets one coordinate in the frame and keeps the others", () => {
    const before = relativeTo(FRAME, POSE).position;
    const after = relativeTo(FRAME, placedAt(POSE, FRAME, "y", 0.7)).position;
    expect(after.x).toBeCloseTo(before.x, 12);
    expect(after.y).toBeCloseTo(0.7, 12);
    expect(after.z).toBeCloseTo(before.z, 12);
  });

  it("snaps to the grid of the frame along the named axes", () => {
    const seen = relativeTo(FRAME, { ...ORIGIN, position: onGrid(POSE.position, FRAME, 0.1, ["x"]) }).position;
    const before = relativeTo(FRAME, POSE).position;
    expect(seen.x).toBeCloseTo(Math.round(before.x * 10) / 10, 12);
    expect(seen.y).toBeCloseTo(before.y, 12);
  });
});

describe("turning", () => {
  it("is about an axis of the frame, around the origin of the item", () => {
    const to = turned(POSE, FRAME, "y", 0.3);
    expect(to.position).toEqual(POSE.position);
    expect(
      same(
        composed({ ...ORIGIN, orientation: turn({ x: -1, y: 0, z: 0 }, 0.3) }, { ...POSE, position: ORIGIN.position }),
        { ...to, position: ORIGIN.position },
      ),
    ).toBe(true);
  });

  it("to an angle keeps the other two", () => {
    const before = angles(relativeTo(FRAME, POSE).orientation);
    const after = angles(relativeTo(FRAME, turnedTo(POSE, FRAME, "z", 0.25)).orientation);
    expect(after[0]).toBeCloseTo(before[0], 9);
    expect(after[1]).toBeCloseTo(before[1], 9);
    expect(after[2]).toBeCloseTo(0.25, 9);
  });

  it("aligns to the nearest of the 24 right-angled rotations", () => {
    const near = fromAngles({ x: Math.PI / 2 + 0.2, y: 0.1, z: -Math.PI / 2 - 0.2 });
    const wanted = fromAngles({ x: Math.PI / 2, y: 0, z: -Math.PI / 2 });
    const at = (orientation: typeof near) => ({ position: ORIGIN.position, orientation });
    expect(same(at(squared(near, ORIGIN.orientation)), at(wanted))).toBe(true);
    const tilted = turn(unit("z"), 0.4);
    expect(same(at(squared(turn(unit("z"), 0.5), tilted)), at(tilted))).toBe(true);
  });
});

describe("a pose as text", () => {
  it("is parsed back to the same pose", () => {
    const read = poseFrom(poseText(POSE), ORIGIN);
    expect(read?.position).toEqual(POSE.position);
    for (const part of ["x", "y", "z", "w"] as const)
      expect(read?.orientation[part]).toBeCloseTo(POSE.orientation[part], 5);
  });

  it("can be partial", () => {
    expect(poseFrom("0.1 0.2 -3e-1", POSE)).toEqual({ ...POSE, position: { x: 0.1, y: 0.2, z: -0.3 } });
    expect(poseFrom("[0, 0, 0, 1]", POSE)).toEqual({ ...POSE, orientation: ORIGIN.orientation });
    expect(angles(poseFrom("0 0 0 0 0 90", POSE)?.orientation ?? ORIGIN.orientation)[2]).toBeCloseTo(Math.PI / 2, 9);
    for (const wrong of ["", "1 2", "0.5 0 0 0", "1 2 3 4 5", "here"]) expect(poseFrom(wrong, POSE)).toBeNull();
  });
});

describe("an item that the tablet carries", () => {
  const from = { position: { x: 1, y: 0, z: 0.5 }, orientation: fromAngles({ x: -1, y: 0, z: 0.3 }) };
  const to = { position: { x: 1.2, y: 0.1, z: 0.4 }, orientation: fromAngles({ x: -1.2, y: 0.1, z: 0.5 }) };

  it("keeps its place in the picture, and its orientation in the world", () => {
    const after = carried(POSE, from, to, false);
    expect(after.orientation).toEqual(POSE.orientation);
    const [seen, before] = [relativeTo(to, after).position, relativeTo(from, POSE).position];
    for (const axis of ["x", "y", "z"] as const) expect(seen[axis]).toBeCloseTo(before[axis], 3);
  });

  it("turns with the tablet where it is", () => {
    const after = carried(POSE, from, to, true);
    expect(after.position).toEqual(POSE.position);
    expect(same(relativeTo(to, after), { ...relativeTo(from, POSE), position: relativeTo(to, after).position })).toBe(
      true,
    );
  });

  it("stays where it is while the tablet does not move", () => {
    expect(carried(POSE, from, from, false).position.x).toBeCloseTo(POSE.position.x, 6);
    expect(same(carried(POSE, from, from, true), POSE)).toBe(true);
  });
});
