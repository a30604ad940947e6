import { expect, test } from "vitest";
import { documentFrom } from "../store/document";
import { initialState, type State } from "../store/state";
import { allOf, counts, fitting, flat, narrowed, neighbour, thingsOf } from "./things";
import { faintness } from "./visibility";

const UPRIGHT = { x: 0, y: 0, z: 0, w: 1 };
const POSE = { position: { x: 0, y: 0, z: 0 }, orientation: UPRIGHT };
const point = (id: string, name: string, parent?: string, more: object = {}) => ({
  id,
  name,
  parent,
  position: POSE.position,
  orientations: [],
  robot_joints: [],
  actions: [],
  ...more,
});

function workplace(): State {
  const state = initialState();
  state.types.robots = { UR5e: { type: "UR5e" } as never };
  state.doc = documentFrom(
    {
      id: "scn",
      name: "cell",
      description: "",
      objects: [
        { id: "table", name: "table", type: "Box", pose: POSE, parameters: [] },
        { id: "arm", name: "arm", type: "UR5e", pose: POSE, parameters: [] },
        { id: "orders", name: "orders", type: "Erp", parameters: [] },
      ],
    },
    {
      id: "pro",
      name: "p",
      scene_id: "scn",
      description: "",
      has_logic: true,
      action_points: [
        point("grid", "grid", "table"),
        point("pick", "pick", "grid", {
          orientations: [{ id: "down", name: "down", orientation: UPRIGHT }],
          actions: [{ id: "grip", name: "grip", type: "arm/grip", parameters: [], flows: [] }],
        }),
        point("home", "home"),
      ],
      parameters: [],
      functions: [],
      logic: [{ id: "first", start: "START", end: "grip" }],
      object_overrides: [],
    } as never,
  );
  return state;
}
const names = (rows: { name: string }[]) => rows.map((each) => each.name);

test("items are below their parents; items without a pose and the program are separate", () => {
  const things = thingsOf(workplace());
  expect(names(things.placed)).toEqual(["arm", "table", "home"]);
  expect(names(flat(things.placed))).toEqual(["arm", "table", "grid", "pick", "grip", "down", "home"]);
  expect(names(things.unplaced)).toEqual(["orders"]);
  expect(names(things.program)).toEqual(["Start", "End", "Start → grip"]);
  expect(counts(allOf(things))).toEqual({ robots: 1, objects: 2, points: 3, actions: 1, program: 3, others: 1 });
  expect(thingsOf(initialState())).toEqual({ placed: [], unplaced: [], program: [] });
});

test("matching items are shown with their ancestors", () => {
  const { placed } = thingsOf(workplace());
  const shown = (groups: string[], words: string) => names(flat(narrowed(placed, fitting(new Set(groups), words))));
  expect(shown(["actions"], "")).toEqual(["table", "grid", "pick", "grip"]);
  expect(shown([], "PICK action")).toEqual(["table", "grid", "pick"]);
  expect(shown(["robots", "points"], "h")).toEqual(["home"]);
  expect(shown(["actions"], "pick")).toEqual([]);
  expect(shown([], "")).toHaveLength(7);
});

test("the next and previous item are found cyclically", () => {
  const rows = flat(thingsOf(workplace()).placed);
  expect(neighbour(rows, "pick", 1)?.name).toBe("grip");
  expect(neighbour(rows, "pick", -1)?.name).toBe("grid");
  expect(neighbour(rows, "home", 1)?.name).toBe("arm");
  expect(neighbour(rows, "arm", -1)?.name).toBe("home");
  expect(neighbour(rows, "gone", 1)?.name).toBe("arm");
  expect([neighbour(rows.slice(0, 1), "arm", 1), neighbour([], "arm", 1)]).toEqual([null, null]);
});

test("hidden, transparent and faded items have their transparency", () => {
  const state = workplace();
  const seen = (user: Record<string, unknown>, ids: string[]) => {
    const of = faintness({ ...state, view: { ...state.view, user } });
    return ids.map(of);
  };
  const all = ["table", "arm", "pick", "grip", "START"];
  expect(seen({}, all)).toEqual([0, 0, 0, 0, 0]);
  expect(seen({ blocklist: ["table"], opacity: { arm: 0.25 } }, all)).toEqual([1, 0.75, 0, 0, 0]);
  // All objects except robots; the larger transparency applies.
  expect(seen({ opacity_all: 0.5, opacity: { table: 0.25 } }, all)).toEqual([0.75, 0, 0, 0, 0]);
  expect(seen({ opacity_all: 0.5, opacity: { table: 0.75 } }, all)[0]).toBe(0.5);
  expect(seen({ filters: ["points", "no such"], fade_others: true }, all)).toEqual([0.85, 0.85, 0, 1, 1]);
  expect(seen({ filters: ["points"] }, all)).toEqual([0, 0, 0, 0, 0]);
  expect(seen({ hide_orientations: true }, ["down", "pick"])).toEqual([1, 0]);
  expect(
    seen({ filters: "points", opacity_all: "half", opacity: { arm: "much" }, blocklist: 3, fade_others: true }, all),
  ).toEqual([0, 0, 0, 0, 0]);
  state.ui.selection = { kind: "action", id: "grip" };
  expect(seen({ filters: ["points"], fade_others: true }, all)[3]).toBe(0); // the selected item stays
});
