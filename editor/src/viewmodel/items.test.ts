import { expect, test } from "vitest";
import { documentFrom } from "../store/document";
import { initialState, type State } from "../store/state";
import { ItemMaker, plain } from "./items";
import { terminalPlaces } from "./program";
import { rollPitchYaw } from "./rotations";
import { shapeOf } from "./shapes";

const UPRIGHT = { x: 0, y: 0, z: 0, w: 1 };
const POSE = { position: { x: 0.5, y: 0, z: 0 }, orientation: UPRIGHT };

function workplace(): State {
  const state = initialState();
  state.connection.user = "me";
  state.types.byName = {
    Box: { type: "Box", object_model: { type: "Box", box: { id: "Box", size_x: 1, size_y: 2, size_z: 3 } } } as never,
  };
  state.types.robots = { UR5e: { type: "UR5e", urdf_package_filename: "ur5e.zip" } as never };
  state.doc = documentFrom(
    {
      id: "scn",
      name: "cell",
      description: "",
      objects: [
        { id: "box", name: "table", type: "Box", pose: POSE, parameters: [] },
        { id: "ur", name: "robot", type: "UR5e", pose: POSE, parameters: [] },
        { id: "erp", name: "orders", type: "Erp", parameters: [] },
      ],
    },
    {
      id: "pro",
      name: "p",
      scene_id: "scn",
      description: "",
      has_logic: true,
      action_points: [
        {
          id: "acp",
          name: "pick",
          position: POSE.position,
          parent: "box",
          orientations: [{ id: "ori", name: "down", orientation: UPRIGHT }],
          robot_joints: [],
          actions: [
            { id: "a1", name: "move", type: "ur/move", parameters: [], flows: [] },
            { id: "a2", name: "grip", type: "ur/grip", parameters: [], flows: [] },
          ],
        },
      ],
      parameters: [],
      functions: [],
      logic: [
        { id: "l1", start: "START", end: "a1" },
        { id: "l2", start: "a1", end: "a2", condition: { what: "a1/default/0", value: "false" } },
        { id: "l3", start: "a1", end: "END", condition: { what: "a1/default/0", value: '"firm"' } },
      ],
      object_overrides: [],
    },
  );
  return state;
}
const items = (state: State) => Object.fromEntries(new ItemMaker().items(state).map((item) => [item.id, item]));

test("each object and point with a pose has an item", () => {
  const made = items(workplace());
  expect(Object.keys(made).sort()).toEqual(["END", "START", "a1", "a2", "acp", "box", "l1", "l2", "l3", "ori", "ur"]);
  expect(made.box).toMatchObject({ kind: "object", shape: { kind: "box", size: [1, 2, 3] } });
  expect(made.ur).toMatchObject({ kind: "robot", urdf: "ur5e.zip", online: false, axes: true });
  const plain = workplace();
  plain.view.user = { hide_axes: true };
  expect(items(plain).ur).toMatchObject({ axes: false });
  expect(made.acp).toMatchObject({ kind: "point", parent: "box" });
  expect(made.a2).toMatchObject({ level: 1, parent: "acp" });
});

test("connections have the kind and text of their branch", () => {
  const made = items(workplace());
  expect(made.l1).toMatchObject({ branch: "always", condition: "" });
  expect(made.l2).toMatchObject({ branch: "false", condition: "no" });
  expect(made.l3).toMatchObject({ branch: "value", condition: "firm" });
  const failing = workplace();
  failing.doc = {
    ...failing.doc,
    logic: { l3: { id: "l3", start: "a1", end: "a2", error_kinds: ["refused"] } },
  } as never;
  expect(items(failing).l3).toMatchObject({ branch: "error", condition: "on error: Refused", taken: false });
});

test("unchanged items are the same objects", () => {
  const maker = new ItemMaker();
  const state = workplace();
  const first = new Map(maker.items(state).map((item) => [item.id, item]));
  const next = {
    ...state,
    ui: { ...state.ui, selection: { kind: "object", id: "box" } as const },
    locks: { a1: "Eva" },
  };
  const differing = maker.items(next).filter((item) => first.get(item.id) !== item);
  expect(differing.map((item) => [item.id, item.selected, item.lockedBy])).toEqual([
    ["box", true, ""],
    ["a1", false, "Eva"],
  ]);
});

test("previews, positions, visibility and reachability are applied", () => {
  const state = workplace();
  state.previews = { acp: { id: "acp", user: "Eva", position: { x: 9, y: 0, z: 0 } } };
  state.view.shared = { "place/START": { x: 1, y: 2, z: 3 }, "place/END": { x: "no" } };
  state.view.user = { blocklist: ["box"], opacity: { ur: 0.25 } };
  state.reach = {
    "r1//e": { items: [{ id: "ori", reach: "out_of_reach" }] } as never,
    "r2//e": { items: [{ id: "ori", reach: "near_limit" }] } as never,
  };
  const made = items(state);
  expect(made.acp).toMatchObject({ position: { x: 9 } });
  expect(made.START).toMatchObject({ position: { x: 1, y: 2, z: 3 } });
  expect(made.END).toMatchObject({ position: { x: expect.any(Number) } });
  expect([made.box?.faint, made.ur?.faint]).toEqual([1, 0.75]);
  expect(made.ori).toMatchObject({ reach: "near_limit" }); // by the best robot
});

test("a type without a model has a marker, and values are shown without JSON quotes", () => {
  expect(shapeOf(undefined)).toEqual({ kind: "none" });
  expect([plain('"firm"'), plain("3"), plain("{half")]).toEqual(["firm", "3", "{half"]);
});

test("rotations are converted to roll, pitch and yaw", () => {
  const half = Math.SQRT1_2;
  const cases: [[number, number, number, number], [number, number, number]][] = [
    [
      [0, 0, 0, 1],
      [0, 0, 0],
    ],
    [
      [half, 0, 0, half],
      [90, 0, 0],
    ],
    [
      [0, 0, half, half],
      [0, 0, 90],
    ],
    [
      [0, half, 0, half],
      [0, 90, 0],
    ],
    [
      [1, 0, 0, 0],
      [180, 0, 0],
    ],
  ];
  for (const [[x, y, z, w], expected] of cases) {
    rollPitchYaw({ x, y, z, w }).forEach((each, n) => expect(each).toBeCloseTo(expected[n] ?? NaN));
  }
});

test("the actions of a point are a stack until one of them is selected, and the rest is pale then", () => {
  const state = workplace();
  const of = (what: string) => (items(state)[what] ?? {}) as unknown as Record<string, unknown>;
  expect([of("a1").open, of("a2").dim, of("l2").inside, of("l1").inside]).toEqual([false, false, true, false]);
  state.ui.selection = { kind: "action", id: "a2" };
  expect([of("a1").open, of("l2").inside]).toEqual([true, false]);
  // Its neighbour and the step between them stay as they are.
  expect(["a1", "a2", "l2"].map((id) => of(id).dim)).toEqual([false, false, false]);
  expect(["l1", "l3", "START", "END"].map((id) => of(id).dim)).toEqual([true, true, true, true]);
  // A selected step inside the stack is drawn.
  state.ui.selection = { kind: "logic", id: "l2" };
  expect([of("a1").open, of("l2").inside]).toEqual([true, false]);
  state.ui.selection = { kind: "object", id: "box" };
  expect(of("l1").dim).toBe(false);
});

test("Start and End are near their actions, and clear of bodies, points and each other", () => {
  const { doc, types } = workplace();
  if (!doc) throw new Error();
  const { START, END } = terminalPlaces(doc, types);
  const apart = (a: { x: number; y: number }, b: { x: number; y: number }) => Math.hypot(a.x - b.x, a.y - b.y);
  const point = { x: 1, y: 0 };
  expect(apart(START, END)).toBeGreaterThan(0.15);
  for (const place of [START, END]) {
    expect(apart(place, POSE.position)).toBeGreaterThan(0.28);
    expect(apart(place, point)).toBeGreaterThan(0.15);
  }
  // Without a body in the way they are next to the action.
  const alone = { ...doc, objects: {}, points: { acp: { ...doc.points.acp, parent: undefined } as never } };
  expect(apart(terminalPlaces(alone, types).START, POSE.position)).toBeLessThan(0.25);
});
