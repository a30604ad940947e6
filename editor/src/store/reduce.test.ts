import { describe, expect, test } from "vitest";
import { setTranslations } from "../i18n/testing";
import type { Project, Scene, ServerEvent } from "../protocol/types";
import { reduce } from "./reduce";
import { isClosed } from "./selectors";
import { initialState, type State } from "./state";

const POSE = { position: { x: 0, y: 0, z: 0 }, orientation: { x: 0, y: 0, z: 0, w: 1 } };
const SCENE: Scene = {
  id: "scn",
  name: "cell",
  description: "",
  modified: "2026-01-01T10:00:00+00:00",
  objects: [{ id: "obj", name: "robot", type: "UR5e", pose: POSE, parameters: [] }],
};
const PROJECT: Project = {
  id: "pro",
  name: "sort",
  scene_id: "scn",
  description: "",
  has_logic: true,
  modified: "2026-01-01T10:00:00+00:00",
  action_points: [
    {
      id: "acp",
      name: "pick",
      position: { x: 1, y: 0, z: 0 },
      parent: "obj",
      orientations: [{ id: "ori", name: "default", orientation: POSE.orientation }],
      robot_joints: [],
      actions: [{ id: "act", name: "move", type: "obj/move", parameters: [], flows: [] }],
    },
  ],
  parameters: [],
  functions: [],
  logic: [{ id: "lit", start: "START", end: "act" }],
  object_overrides: [],
};

/** Time of the events, ms since 1970. */
const NOW = 1_700_000_000_000;

function after(...events: ServerEvent[]): State {
  let state = initialState();
  state = { ...state, connection: { ...state.connection, user: "me" } };
  for (const event of events) state = { ...state, ...reduce(state, event, NOW) };
  return state;
}
const OPEN: ServerEvent = { event: "OpenProject", data: { scene: SCENE, project: PROJECT } };

describe("a draft", () => {
  const moved: ServerEvent = {
    event: "SceneObjectChanged",
    change_type: "update",
    data: { id: "obj", name: "robot", type: "UR5e", pose: POSE, parameters: [] },
  };
  const drafted = (continues: boolean): State => {
    const state = after(OPEN);
    return { ...state, ui: { ...state.ui, draft: { id: "obj", of: state.doc?.objects.obj, pose: POSE, continues } } };
  };

  test("ends with the event of its edit", () => {
    expect(reduce(drafted(false), moved, NOW).ui?.draft).toBeUndefined();
  });

  test("continues from the changed item while the user is still changing it", () => {
    const { doc, ui } = reduce(drafted(true), moved, NOW);
    expect(ui?.draft).toMatchObject({ id: "obj", continues: true });
    expect(ui?.draft?.of).toBe(doc?.objects.obj);
  });

  test("ends when its item is removed or the document is closed", () => {
    expect(reduce(drafted(true), { ...moved, change_type: "remove" }, NOW).ui?.draft).toBeUndefined();
    const closed: ServerEvent = { event: "ShowMainScreen", data: { what: "ScenesList" } };
    expect(reduce(drafted(true), closed, NOW).ui?.draft).toBeUndefined();
  });

  test("is not ended by events about other items", () => {
    const state = drafted(false);
    const other: ServerEvent = { event: "JointsChanged", change_type: "remove", data: { id: "x" } as never };
    expect(reduce(state, other, NOW).ui).toBe(state.ui);
  });
});

describe("the open document", () => {
  test("is split into records by id", () => {
    const { doc } = after(OPEN);
    expect(doc?.points.acp).toMatchObject({ name: "pick", parent: "obj" });
    expect(doc?.orientations.ori?.pointId).toBe("acp");
    expect(doc?.actions.act?.pointId).toBe("acp");
    expect(doc?.unsaved).toBe(false);
  });

  test("is unsaved if it was changed after its last save or never saved", () => {
    const changed = { ...PROJECT, int_modified: "2026-01-01T10:00:01+00:00" };
    expect(after({ event: "OpenProject", data: { scene: SCENE, project: changed } }).doc?.unsaved).toBe(true);
    expect(after({ event: "OpenScene", data: { scene: { ...SCENE, modified: undefined } } }).doc?.unsaved).toBe(true);
  });

  test("follows additions, changes and removals at a point", () => {
    const added = after(OPEN, {
      event: "ActionChanged",
      change_type: "add",
      parent_id: "acp",
      data: { id: "act2", name: "grip", type: "obj/grip", parameters: [], flows: [] } as never,
    });
    expect(added.doc?.actions.act2).toMatchObject({ pointId: "acp", type: "obj/grip" });
    expect(added.doc?.unsaved).toBe(true);
    // Events other than "add" do not name the point.
    const renamed = after(OPEN, {
      event: "ActionChanged",
      change_type: "update_base",
      data: { id: "act", name: "go", type: "obj/move" },
    });
    expect(renamed.doc?.actions.act).toMatchObject({ pointId: "acp", name: "go", parameters: [] });
    const gone = after(OPEN, {
      event: "ActionPointChanged",
      change_type: "remove",
      data: { id: "acp", name: "pick", position: POSE.position },
    });
    expect(gone.doc?.points).toEqual({});
    expect(gone.doc?.orientations).toEqual({});
    expect(gone.doc?.actions).toEqual({});
  });

  test("an update of a point alone keeps its items and applies its new parent", () => {
    const moved = after(OPEN, {
      event: "ActionPointChanged",
      change_type: "update_base",
      data: { id: "acp", name: "pick", position: { x: 2, y: 0, z: 0 } },
    });
    expect(moved.doc?.points.acp).toMatchObject({ position: { x: 2 } });
    expect(moved.doc?.points.acp?.parent).toBeUndefined();
    expect(Object.keys(moved.doc?.orientations ?? {})).toEqual(["ori"]);
  });

  test("is saved and closed", () => {
    const change: ServerEvent = { event: "LogicItemChanged", change_type: "remove", data: PROJECT.logic[0] as never };
    expect(after(OPEN, change).doc).toMatchObject({ unsaved: true, logic: {} });
    expect(after(OPEN, change, { event: "ProjectSaved", data: undefined }).doc?.unsaved).toBe(false);
    const closed: ServerEvent = { event: "ProjectClosed", data: undefined };
    expect(after(OPEN, closed).doc, "it stays while it is run as a package").not.toBeNull();
    expect(after(OPEN, closed, { event: "ShowMainScreen", data: { what: "ProjectsList" } }).doc).toBeNull();
  });

  test("keeps the tool of the scene on which a project is created, and no other", () => {
    const scene: ServerEvent = { event: "OpenScene", data: { scene: SCENE } };
    const inTool = (state: State): State => ({ ...state, ui: { ...state.ui, tool: "things" } });
    expect(reduce(inTool(after(scene)), OPEN, NOW).ui?.tool).toBe("things");
    expect(reduce(inTool(after(OPEN)), scene, NOW).ui?.tool).toBe("");
    const other: ServerEvent = { event: "OpenProject", data: { scene: { ...SCENE, id: "other" }, project: PROJECT } };
    expect(reduce(inTool(after(scene)), other, NOW).ui?.tool).toBe("");
  });

  test("keeps the selection after a reconnect if the item still exists", () => {
    const selected = (id: string): State => ({
      ...after(OPEN),
      ui: { ...initialState().ui, selection: { kind: "action", id } },
    });
    expect(reduce(selected("act"), OPEN, NOW).ui?.selection?.id).toBe("act");
    expect(reduce(selected("other"), OPEN, NOW).ui?.selection).toBeNull();
    const removed = reduce(
      selected("act"),
      {
        event: "ActionChanged",
        change_type: "remove",
        data: { id: "act", name: "move", type: "obj/move" },
      },
      NOW,
    );
    expect(removed.ui?.selection).toBeNull();
  });
});

describe("events of other users", () => {
  test("locks are stored by item", () => {
    const held = after(
      { event: "ObjectsLocked", data: { object_ids: ["a", "b"], owner: "Eva" } },
      { event: "ObjectsUnlocked", data: { object_ids: ["a"], owner: "Eva" } },
    );
    expect(held.locks).toEqual({ b: "Eva" });
    expect(Object.keys(held.lockedAt)).toEqual(["b"]);
  });

  test("users who left and ended previews are removed", () => {
    const presence = (online: boolean): ServerEvent => ({
      event: "UserPresence",
      data: { user: "Eva", online, role: "operator" },
    });
    expect(Object.keys(after(presence(true)).users)).toEqual(["Eva"]);
    expect(after(presence(true), presence(false)).users).toEqual({});
    const drag: ServerEvent = { event: "MovePreview", data: { id: "acp", user: "Eva", position: POSE.position } };
    expect(after(drag).previews.acp?.position).toEqual(POSE.position);
    expect(after(drag, { event: "MovePreview", data: { id: "acp", user: "Eva" } }).previews).toEqual({});
  });

  test("view states of other documents and users are ignored", () => {
    const change = (document: string, user: string): ServerEvent => ({
      event: "ViewStateChanged",
      data: { scope: "user", document, user, values: { stars: [1], gone: null }, revision: 2 },
    });
    expect(after(OPEN, change("pro", "me")).view.user).toEqual({ stars: [1] });
    expect(after(OPEN, change("pro", "Eva")).view.user).toEqual({});
    expect(after(OPEN, change("elsewhere", "me")).view.user).toEqual({});
    expect(after(OPEN, change("", "me")).view.general).toEqual({ stars: [1] });
  });
});

describe("operation", () => {
  const online: ServerEvent = { event: "SceneState", data: { state: "started" } };
  const lost: ServerEvent = { event: "ObjectState", data: { object_id: "obj", state: "lost", reason: "cable" } };

  test("going offline clears the state of the devices and keeps the reason", () => {
    expect(after(OPEN, online, lost).live.objects.obj?.reason).toBe("cable");
    const off = after(
      OPEN,
      online,
      lost,
      { event: "SceneState", data: { state: "stopping", message: "no robot" } },
      { event: "SceneState", data: { state: "stopped" } },
    );
    expect(off.live).toMatchObject({ state: "stopped", message: "no robot", objects: {} });
  });

  test("a frozen device process is reported once, and again when it answers", () => {
    const object = (object_id: string, answering?: boolean): ServerEvent => ({
      event: "ObjectState",
      data: { object_id, state: "online", ...(answering === undefined ? {} : { answering }) },
    });
    const frozen = [online, object("a"), object("b"), object("a", false), object("b", false)];
    expect(after(OPEN, ...frozen).notices.map((each) => each.level)).toEqual(["error"]);
    expect(after(OPEN, ...frozen).notices[0]?.text).toContain("do not answer");
    expect(after(OPEN, ...frozen, object("a"), object("b")).notices.map((each) => each.level)).toEqual([
      "error",
      "info",
    ]);
  });

  test("a failed motion is reported", () => {
    const state = after({
      event: "RobotMoveToPose",
      data: {
        move_event_type: "failed",
        robot_id: "obj",
        end_effector_id: "e",
        target_pose: POSE,
        safe: true,
        linear: false,
        message: "too far",
      },
    });
    expect(state.live.moving).toEqual({});
    expect(state.notices.map((each) => [each.level, each.text])).toEqual([["error", "too far"]]);
    expect(state.messageLog).toEqual(state.notices);
  });

  test("actions are running until their end is reported or the program is stopped", () => {
    const before = (id: string): ServerEvent => ({ event: "ActionStateBefore", data: { action_id: id } });
    const state = after({ event: "PackageState", data: { state: "running" } }, before("a"), before("b"), {
      event: "ActionStateAfter",
      data: { action_id: "a" },
    });
    expect(state.program.running).toEqual(["b"]);
    // The end of a failed action is reported by the trace only.
    const entry = { run: 1, number: 1, name: "b", action_id: "b", started: "2026-01-01T00:00:00Z", error: "failed" };
    const failed = reduce(state, { event: "ExecutionTrace", data: entry }, NOW);
    expect(failed.program?.running).toEqual([]);
    expect(
      { ...state, ...reduce(state, { event: "PackageState", data: { state: "stopped" } }, NOW) }.program.running,
    ).toEqual([]);
  });
});

describe("a held program", () => {
  const held: ServerEvent = {
    event: "Held",
    data: {
      run: 1,
      number: 2,
      action_id: "a",
      action_name: "scan",
      device: "obj",
      kind: "device_timeout",
      text: "no answer",
      choices: ["retry", "end"],
      since: "2026-01-01T00:00:00Z",
    },
  };
  const state = (name: "pausing" | "paused" | "running" | "stopping"): ServerEvent => ({
    event: "PackageState",
    data: { state: name },
  });

  test("is held until a decision, or until it runs or stops", () => {
    expect(after(state("pausing"), held, state("paused")).program.held?.number).toBe(2);
    const decided: ServerEvent = { event: "HoldDecided", data: { run: 1, number: 2, choice: "retry", by: "Eva" } };
    for (const end of [decided, state("running"), state("stopping")])
      expect(after(state("pausing"), held, end).program.held).toBeNull();
  });
});

describe("a document that a program closes", () => {
  const CLOSED: ServerEvent = { event: "ProjectClosed", data: undefined };
  const stopped: ServerEvent = { event: "PackageState", data: { state: "stopped" } };

  test("can be edited only when the server has opened it again", () => {
    expect(isClosed(after(OPEN))).toBe(false);
    const info = { scene: SCENE, project: PROJECT, package_id: "pkg", package_name: "sort" };
    for (const end of [[CLOSED], [CLOSED, stopped], [{ event: "PackageInfo", data: info } as ServerEvent, stopped]]) {
      expect(isClosed(after(OPEN, ...end))).toBe(true);
      expect(isClosed(after(OPEN, ...end, OPEN))).toBe(false);
    }
  });

  test("leaves the screen when the server shows a list instead", () => {
    expect(isClosed(after(OPEN, CLOSED, { event: "ShowMainScreen", data: { what: "ProjectsList" } }))).toBe(false);
  });
});

test("removing a type removes its actions", () => {
  const type = { type: "UR5e", settings: [] } as never;
  let state = after({ event: "ChangedObjectTypes", change_type: "add", data: [type] });
  state = { ...state, types: { ...state.types, actions: { UR5e: [] } } };
  state = { ...state, ...reduce(state, { event: "ChangedObjectTypes", change_type: "update", data: [type] }, NOW) };
  expect(state.types.actions).toEqual({}); // they have to be requested again
  state = { ...state, ...reduce(state, { event: "ChangedObjectTypes", change_type: "remove", data: [type] }, NOW) };
  expect(state.types.byName).toEqual({});
});

test("the problem of a type is in the user's language", () => {
  setTranslations({ "{path}:{line}: {problem}": "{path}, řádek {line}: {problem}", "No {name}.": "Chybí {name}." });
  const problem = { text: "No Arm.", key: "No {name}.", values: { name: "Arm" } };
  const message = { key: "{path}:{line}: {problem}", values: { path: "arm.py", line: "3", problem } };
  const type = { type: "Arm", settings: [], problem: "arm.py:3: No Arm.", ...message } as never;
  const state = after({ event: "ChangedObjectTypes", change_type: "add", data: [type] });
  setTranslations({});
  expect(state.types.byName.Arm?.problem).toBe("arm.py, řádek 3: Chybí Arm.");
});

test("reasons of reachability are in the user's language", () => {
  setTranslations({ "{joint} would be near its limit.": "{joint} by byl blízko meze." });
  const message = {
    reason: "j1 would be near its limit.",
    key: "{joint} would be near its limit.",
    values: { joint: "j1" },
  };
  const items = [{ id: "ori", reach: "near_limit" as const, ...message }];
  const data = { robot_id: "obj", end_effector_id: "tcp", revision: 1, items };
  const [row] = Object.values(after(OPEN, { event: "ReachabilityChanged", data }).reach);
  setTranslations({});
  expect(row?.items[0]?.reason).toBe("j1 by byl blízko meze.");
});

test("statistics change the run they belong to", () => {
  const run = { number: 3, package_id: "p", package_name: "p", started: "", end: "running", actions: 0 } as never;
  const changed = after(
    { event: "RunChanged", data: run },
    { event: "RunStatistics", data: { run: 3, cycles: 2, good: 1, bad: 0, counters: [] } },
    { event: "RunStatistics", data: { run: 2, cycles: 9, counters: [] } },
  );
  expect(changed.program.runs.map(({ statistics }) => statistics)).toEqual([
    { cycles: 2, good: 1, bad: 0, counters: [] },
  ]);
});
