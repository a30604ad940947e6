import { expect, test, vi } from "vitest";
import { detect } from "./detector";
import type { Vec3 } from "./geometry";
import { KNOWN, LensLearner, lensOf } from "./lens";
import { layoutOf, type MarkerTable } from "./places";
import { fitView, type Lens, projected, type View } from "./pose";
import { jumpBetween, register } from "./registration";
import { type Drawing, drawn, looking, overlayError } from "./testing";
import { type Found, Tracker } from "./tracker";

// Drawing pictures takes long on a busy machine.
vi.setConfig({ testTimeout: 60_000 });

const half = Math.SQRT1_2;
const FLAT = { x: 0, y: 0, z: 0, w: 1 };
const at = (x: number, y: number, z = 0) => ({ x, y, z });
/** Three markers on a table, and an upright one behind them. */
const TABLE: MarkerTable = {
  markers: [
    { marker_id: 10, pose: { position: at(0, 0), orientation: FLAT } },
    { marker_id: 11, pose: { position: at(0.38, 0.05), orientation: { x: 0, y: 0, z: 0.2, w: 0.98 } } },
    { marker_id: 12, pose: { position: at(0.1, 0.34), orientation: FLAT } },
    { marker_id: 13, pose: { position: at(0.45, 0.5, 0.15), orientation: { x: half, y: 0, z: 0, w: half } } },
  ],
};
const LAYOUT = layoutOf(TABLE);
const SIZE = { width: 960, height: 540 };
const LENS: Lens = { focal: 750, cx: 479.5, cy: 269.5 };
const RELATIVE = LENS.focal / SIZE.width;
const MIDDLE: Vec3 = [0.2, 0.2, 0];
const ASIDE: Vec3[] = [
  [0.7, 0.2, 0.1],
  [0.2, 0.2, 0.5],
  [-0.3, 0.2, 0.1],
];
const CHECKED = { deviation: 0.001, known: true };

/** A view from a direction, rad, at a distance, m. */
const from = (angle: number, distance: number): View =>
  looking(
    [0.2 + distance * 0.75 * Math.cos(angle), 0.2 + distance * 0.75 * Math.sin(angle), 0.66 * distance],
    [0.2, 0.2, 0],
  );
const picture = (view: View, more: Partial<Drawing> = {}, table = TABLE) =>
  drawn(table, { ...SIZE, lens: LENS, view, ...more });
const ids = (seen: readonly { id: number }[]) => seen.map(({ id }) => id).sort((a, b) => a - b);

test("markers are found where they are", () => {
  const view = from(-1.4, 1.1);
  const seen = detect(picture(view), LAYOUT.codes);
  expect(ids(seen)).toEqual([10, 11, 12, 13]);
  for (const { id, corners } of seen) {
    corners.forEach((corner, i) => {
      const expected = projected(LAYOUT.places.get(id)?.corners[i] as Vec3, view, LENS) as [number, number];
      expect(Math.hypot(corner[0] - expected[0], corner[1] - expected[1])).toBeLessThan(0.35);
    });
  }
});

test.each([
  ["blurred", { blur: 1.6, noise: 6 }],
  ["dim", { white: 85, black: 30, noise: 6 }],
  ["bright", { white: 255, black: 150, noise: 3 }],
])("markers are found in a %s picture", (_, more) => {
  expect(ids(detect(picture(from(-1.2, 1.2), more), LAYOUT.codes))).toEqual([10, 11, 12, 13]);
});

test("a covered marker is not found, and does not disturb the others", () => {
  const view = from(-1.4, 1.1);
  const [x, y] = projected([0, 0, 0], view, LENS) as [number, number];
  const cover = (px: number, py: number) => (Math.hypot(px - x - 18, py - y) < 22 ? 120 : undefined);
  const seen = detect(picture(view, { cover }), LAYOUT.codes);
  expect(ids(seen)).toEqual([11, 12, 13]);
  const found = register(seen, LAYOUT.places, LENS, CHECKED);
  expect(overlayError(MIDDLE, [view, LENS], [found?.view as View, LENS])).toBeLessThan(0.001);
});

test("only configured markers count", () => {
  const others = layoutOf({ markers: [{ marker_id: 3, pose: { position: at(0, 0), orientation: FLAT } }] });
  const seen = detect(picture(from(-1.4, 1.1)), others.codes);
  expect(seen).toEqual([]);
  expect(register(seen, others.places, LENS, CHECKED)).toBeNull();
});

test("the overlay fits between the markers and half a metre from them", () => {
  for (const [angle, distance] of [
    [-1.9, 0.7],
    [-1.2, 1.1],
    [-0.5, 1.5],
  ] as const) {
    const view = from(angle, distance);
    const found = register(detect(picture(view), LAYOUT.codes), LAYOUT.places, LENS, CHECKED);
    expect(found?.grade).toBe("good");
    const error = (point: Vec3) => overlayError(point, [view, LENS], [found?.view as View, LENS]);
    expect(error(MIDDLE)).toBeLessThan(0.001);
    for (const point of ASIDE) expect(error(point)).toBeLessThan(0.002);
  }
});

test("one marker from the front is rough, and a second one helps", () => {
  const one: MarkerTable = { markers: TABLE.markers?.slice(0, 1) ?? [] };
  const above = looking([0.02, -0.05, 1.2], [0, 0, 0]);
  const seen = detect(picture(above), LAYOUT.codes);
  const rough = register(
    seen.filter(({ id }) => id === 10),
    layoutOf(one).places,
    LENS,
    CHECKED,
  );
  expect(rough).toMatchObject({ grade: "rough", used: [10] });
  const both = register(seen, LAYOUT.places, LENS, CHECKED);
  expect(both?.used.length).toBeGreaterThan(1);
  expect(both?.error).toBeLessThan((rough?.error ?? 0) / 2);
});

test("a misplaced marker is named and left out", () => {
  const view = from(-1.4, 1.1);
  const seen = detect(picture(view), LAYOUT.codes);
  const moved = layoutOf({
    markers: (TABLE.markers ?? []).map((each) =>
      each.marker_id === 12 ? { ...each, pose: { ...each.pose, position: at(0.12, 0.34) } } : each,
    ),
  });
  const found = register(seen, moved.places, LENS, CHECKED);
  expect(found).toMatchObject({ contradicting: [12], undecided: false });
  expect(overlayError(MIDDLE, [view, LENS], [found?.view as View, LENS])).toBeLessThan(0.001);
  // Of two markers that contradict each other, the misplaced one cannot be found.
  const two = seen.filter(({ id }) => id === 10 || id === 12);
  expect(register(two, moved.places, LENS, CHECKED)).toMatchObject({ grade: "rough", undecided: true });
});

test("the focal length is found while the camera moves, and unchecked before", () => {
  const tracker = new Tracker({ ...LAYOUT, focal: null }, new LensLearner(LAYOUT.places));
  const steps: [number, number][] = [
    [-1.9, 0.8],
    [-1.5, 0.9],
    [-1.1, 1.1],
    [-0.7, 1.2],
    [-1.3, 0.7],
  ];
  const found: Found[] = [];
  for (const [angle, distance] of steps) found.push(tracker.process(picture(from(angle, distance))));
  expect(found[0]?.checked).toBe(false);
  expect(found[0]?.registration?.grade).toBe("rough");
  const last = found.at(-1) as Found;
  expect(last.checked).toBe(true);
  expect(last.focal.deviation).toBeLessThanOrEqual(KNOWN);
  expect(Math.abs(last.focal.relative / RELATIVE - 1)).toBeLessThan(0.005);
  const view = from(-1.3, 0.7);
  const lens = lensOf(last.focal, SIZE.width, SIZE.height);
  for (const point of ASIDE) {
    expect(overlayError(point, [view, LENS], [last.registration?.view as View, lens])).toBeLessThan(0.003);
  }
});

test("a misplaced marker does not spoil the focal length", () => {
  const moved = layoutOf({
    markers: (TABLE.markers ?? []).map((each) =>
      each.marker_id === 12 ? { ...each, pose: { ...each.pose, position: at(0.13, 0.34) } } : each,
    ),
  });
  const tracker = new Tracker({ ...moved, focal: null }, new LensLearner(moved.places));
  let last: Found | undefined;
  for (const [angle, distance] of [
    [-1.9, 0.8],
    [-1.4, 1],
    [-0.9, 1.2],
    [-1.3, 0.7],
  ] as const) {
    last = tracker.process(picture(from(angle, distance)));
  }
  expect(last?.registration?.contradicting).toEqual([12]);
  expect(Math.abs((last?.focal.relative ?? 0) / RELATIVE - 1)).toBeLessThan(0.01);
});

test("the reason of a loss is known", () => {
  const tracker = new Tracker(
    { ...LAYOUT, focal: { relative: RELATIVE, deviation: 0.001 } },
    new LensLearner(LAYOUT.places),
  );
  const view = from(-1.2, 1.1);
  expect(tracker.process(picture(view)).loss).toBeNull();
  expect(tracker.process(picture(view, { white: 24, black: 8, noise: 1 })).loss).toBe("dark");
  expect(tracker.process(picture(view, { blur: 12, noise: 1 })).loss).toBe("blurred");
  const away = looking([0.2, -0.8, 0.7], [0.2, -3, 0.7]);
  expect(tracker.process(picture(away, { noise: 12 })).loss).toBe("unseen");
});

test("a view that moved is noticed", () => {
  const [before, after] = [from(-1.2, 1.1), from(-1.2, 1.12)];
  expect(jumpBetween(before, before, ASIDE)).toBe(0);
  expect(jumpBetween(before, after, ASIDE)).toBeGreaterThan(0.015);
  expect(fitView([], LAYOUT.places, LENS)).toBeNull();
});
