/** The reducer: return the changes that an event makes to the state. A pure function of state, event and time. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { inUserLanguage } from "../i18n/serverMessages";
import type { Run, ServerEvent, TaskProgress, TaskStateData } from "../protocol/types";
import { documentAfter, documentFrom, itemOf } from "./document";
import { translatedType } from "./objectTypeTexts";
import { put, without } from "./records";
import { inScope } from "./scope";
import { NO_PROGRAM, type Notice, OFFLINE, type OpenDocument, type State } from "./state";
import type { Draft, Selection } from "./ui";

/** Largest number of stored notices, entries of the trace, and results of single actions. */
const NOTICES = 200;
const TRACE = 1000;
const SINGLE_RESULTS = 50;

/** Return the notices with one more. `time` is in ms since 1970. */
export function notice(
  state: State,
  level: Notice["level"],
  text: string,
  time: number,
): Pick<State, "notices" | "messageLog"> {
  const added = { id: (state.messageLog.at(-1)?.id ?? 0) + 1, level, text, time };
  return {
    notices: [...state.notices, added].slice(-NOTICES),
    messageLog: [...state.messageLog, added].slice(-NOTICES),
  };
}

/** The part of the state that belongs to the open document, without one. */
const CLOSED = {
  doc: null,
  live: OFFLINE,
  history: null,
  previews: {},
  breakpoints: {},
  reach: {},
} satisfies Partial<State>;

/** Return the changes made by an event that arrived at `time`, ms since 1970. */
export function reduce(state: State, event: ServerEvent, time: number): Partial<State> {
  if (state.doc) {
    const doc = documentAfter(state.doc, event);
    if (doc !== state.doc) return { doc, ...reduceLists(state, event), ui: screenOf(state, doc) };
  }
  switch (event.event) {
    case "OpenScene":
      return open(state, documentFrom(event.data.scene, null));
    case "OpenProject":
      return open(state, documentFrom(event.data.scene, event.data.project));
    case "SceneClosed":
    case "ProjectClosed":
      // The document leaves the screen with ShowMainScreen; a project that is about to run stays.
      return { live: OFFLINE, doc: state.doc && { ...state.doc, closed: true } };
    case "ShowMainScreen":
      return {
        ...CLOSED,
        view: { ...state.view, user: {}, shared: {}, scene: {} },
        ui: uiWithoutDocument(state),
        program: { ...state.program, running: [] },
        lists: { ...state.lists, shown: event.data.what, highlight: event.data.highlight ?? "" },
      };
    case "SceneChanged":
    case "ProjectChanged":
    case "PackageChanged":
      return reduceLists(state, event);
    case "ObjectsLocked":
      return {
        locks: { ...state.locks, ...Object.fromEntries(event.data.object_ids.map((id) => [id, event.data.owner])) },
        // A repeated event about the same owner does not restart the time.
        lockedAt: {
          ...state.lockedAt,
          ...Object.fromEntries(
            event.data.object_ids.filter((id) => state.locks[id] !== event.data.owner).map((id) => [id, time]),
          ),
        },
      };
    case "ObjectsUnlocked":
      return {
        locks: without(state.locks, ...event.data.object_ids),
        lockedAt: without(state.lockedAt, ...event.data.object_ids),
      };
    case "UserPresence":
      return {
        users: event.data.online
          ? put(state.users, event.data.user, event.data)
          : without(state.users, event.data.user),
      };
    case "MovePreview": {
      const { position, orientation, joints, id } = event.data;
      const over = !position && !orientation && !joints;
      return { previews: over ? without(state.previews, id) : put(state.previews, id, event.data) };
    }
    case "ChangedObjectTypes": {
      const names = event.data.map((type) => type.type);
      const given = Object.fromEntries(event.data.map((type) => [type.type, translatedType(type)]));
      const byName =
        event.change_type === "remove" ? without(state.types.byName, ...names) : { ...state.types.byName, ...given };
      return { types: { ...state.types, byName, actions: without(state.types.actions, ...names) } };
    }
    case "HistoryChanged":
      return { history: event.data };
    case "BreakpointsChanged":
      if (event.data.project_id !== state.doc?.project?.id) return {};
      return { breakpoints: Object.fromEntries(event.data.ids.map((id) => [id, true])) };
    case "ReachabilityChanged": {
      const key = [event.data.robot_id, event.data.arm_id ?? "", event.data.end_effector_id].join("/");
      const known = Object.fromEntries((state.reach[key]?.items ?? []).map((item) => [item.id, item]));
      for (const item of event.data.items) known[item.id] = inUserLanguage(item);
      return { reach: put(state.reach, key, { ...event.data, items: Object.values(known) }) };
    }
    case "ViewStateChanged":
      return reduceViewState(state, event.data);
    case "ForcesChanged":
      return { forces: event.data.forces };
    case "NodesChanged":
      return { nodes: event.data };
    case "Notification": {
      const level = event.data.level === "Info" ? "info" : event.data.level === "Warn" ? "warn" : "error";
      return notice(state, level, event.data.message, time);
    }
    case "TaskState":
      return { tasks: put(state.tasks, event.data.id, event.data), ...taskMessage(state, event.data, time) };
    default:
      return reduceLive(state, event, time) ?? reduceProgram(state, event) ?? {};
  }
}

const OUTCOMES: Record<TaskProgress, MessageDescriptor> = {
  running: msg`running`,
  finished: msg`finished`,
  failed: msg`failed`,
  cancelled: msg`cancelled`,
};

/** Add a finished task to the stored messages. */
function taskMessage(
  state: State,
  { title, state: outcome, message }: TaskStateData,
  time: number,
): Pick<State, "messageLog"> | object {
  if (outcome === "running") return {};
  const { messageLog } = notice(
    state,
    outcome === "failed" ? "error" : "info",
    [t`${title}: ${i18n._(OUTCOMES[outcome])}.`, message].filter(Boolean).join(" "),
    time,
  );
  return { messageLog };
}

function open(state: State, doc: NonNullable<State["doc"]>): Partial<State> {
  const sameScene = state.doc?.scene.id === doc.scene.id;
  if (state.doc && sameScene && state.doc.project?.id === doc.project?.id) {
    const still = inScope(doc, state.doc.path);
    return { doc: still, ui: screenOf(state, still) };
  }
  // A project that is created on the open scene has the tools of the scene, too: the user may have just opened one.
  const tool = sameScene && !state.doc?.project ? state.ui.tool : "";
  return { ...CLOSED, doc, ui: { ...uiWithoutDocument(state), tool } };
}

/** Return the screen state without what belonged to the open document. */
function uiWithoutDocument(state: State): State["ui"] {
  const { draft: _, ...ui } = state.ui;
  return { ...ui, selection: null, connecting: null, picked: null, ghost: null, mode: "3d", tool: "" };
}

/** Return the screen state for a changed document. */
function screenOf(state: State, doc: OpenDocument): State["ui"] {
  const selection = keptSelection(state.ui.selection, doc);
  const draft = keptDraft(state.ui.draft, doc);
  return selection === state.ui.selection && draft === state.ui.draft ? state.ui : { ...state.ui, selection, draft };
}

/** Return the selection; null if the selected item no longer exists. */
function keptSelection(selection: Selection | null, doc: OpenDocument): Selection | null {
  if (!selection || (selection.kind === "terminal" && doc.project?.has_logic)) return selection;
  const { id } = selection;
  const exists = [doc.objects, doc.points, doc.orientations, doc.joints, doc.actions, doc.logic].some((of) => id in of);
  return exists ? selection : null;
}

/** Return the draft; undefined if its item has changed, unless the user is still changing it. */
function keptDraft(draft: Draft | undefined, doc: OpenDocument): Draft | undefined {
  const item = draft && itemOf(doc, draft.id);
  if (!draft || item === draft.of) return draft;
  return draft.continues && item !== undefined ? { ...draft, of: item } : undefined;
}

/** Return the lists of the home screen after an event. */
function reduceLists(state: State, event: ServerEvent): Partial<State> {
  const removed = event.change_type === "remove";
  const merged = <T extends { id: string }>(items: T[] | null, item: T): T[] | null => {
    if (!items) return null;
    const rest = items.filter((each) => each.id !== item.id);
    if (removed) return rest;
    const known = items.find((each) => each.id === item.id);
    return [...rest, { ...known, ...item }];
  };
  switch (event.event) {
    case "SceneChanged":
      return { lists: { ...state.lists, scenes: merged(state.lists.scenes, event.data as never) } };
    case "ProjectChanged":
      return { lists: { ...state.lists, projects: merged(state.lists.projects, event.data) } };
    case "PackageChanged":
      return { lists: { ...state.lists, packages: merged(state.lists.packages, event.data) } };
    default:
      return {};
  }
}

function reduceViewState(state: State, data: import("../protocol/types").ViewState): Partial<State> {
  const { doc, connection } = state;
  const parts: (keyof State["view"])[] = [];
  if (data.document === "") parts.push("general");
  else if (data.document === (doc?.project?.id ?? doc?.scene.id)) parts.push(data.scope);
  if (doc && data.document === doc.scene.id && data.scope === "shared") parts.push("scene");
  if (data.scope === "user" && data.user !== undefined && data.user !== connection.user) return {};
  const view = { ...state.view };
  for (const part of parts) {
    const values = { ...view[part] };
    for (const [key, value] of Object.entries(data.values)) {
      if (value === null) delete values[key];
      else values[key] = value;
    }
    view[part] = values;
  }
  return parts.length > 0 ? { view } : {};
}

function isAnswering(objects: State["live"]["objects"]): boolean {
  return Object.values(objects).every((each) => each.answering !== false);
}

/** Return the state of the online scene; null if the event does not affect it. */
function reduceLive(state: State, event: ServerEvent, time: number): Partial<State> | null {
  const now = state.live;
  const become = (change: Partial<typeof now>) => ({ live: { ...now, ...change } });
  switch (event.event) {
    case "SceneState": {
      const { state: next, message = "" } = event.data;
      if (next === "stopped") return { live: { ...OFFLINE, message: message || now.message } };
      if (next === "starting") return { live: { ...OFFLINE, state: next, message } };
      return become({ state: next, message });
    }
    case "ObjectState": {
      const objects = put(now.objects, event.data.object_id, event.data);
      const was = isAnswering(now.objects);
      if (was === isAnswering(objects)) return become({ objects });
      if (was)
        return {
          ...become({ objects }),
          ...notice(
            state,
            "error",
            t`The devices do not answer: their process is overloaded. If a robot moves, use the emergency stop.`,
            time,
          ),
        };
      return {
        ...become({ objects }),
        ...(event.data.state === "offline" ? {} : notice(state, "info", t`The devices are answering again.`, time)),
      };
    }
    case "ObjectHealth":
      return become({ health: put(now.health, event.data.object_id, event.data) });
    case "ObjectValues":
      return become({ values: put(now.values, event.data.object_id, event.data) });
    case "RobotHold": {
      const { robot_id, held } = event.data;
      return become({ holds: held ? put(now.holds, robot_id, event.data) : without(now.holds, robot_id) });
    }
    case "HandTeachingMode":
      return become({ handTeaching: put(now.handTeaching, event.data.robot_id, event.data.enabled) });
    case "RobotMoveToPose":
    case "RobotMoveToJoints":
    case "RobotMoveToActionPointOrientation":
    case "RobotMoveToActionPointJoints": {
      const { move_event_type: phase, robot_id, message } = event.data;
      const moving = phase === "start" ? put(now.moving, robot_id, event.event) : without(now.moving, robot_id);
      const goal =
        "orientation_id" in event.data
          ? event.data.orientation_id
          : "joints_id" in event.data
            ? event.data.joints_id
            : "";
      const motions = put(now.motions, robot_id, { phase, goal, message: message ?? "" });
      const failure =
        phase === "failed" ? notice(state, "error", message || t`The robot did not reach its goal.`, time) : {};
      return { ...become({ moving, motions }), ...failure };
    }
    case "ActionExecution":
      return become({ executing: event.data.action_id, result: null });
    case "ActionResult":
      return {
        ...become({ executing: "", result: event.data }),
        singleResults: [...state.singleResults, { ...event.data, time }].slice(-SINGLE_RESULTS),
      };
    case "ActionCancelled":
      return become({ executing: "" });
    case "ProcessState": {
      const { id, state: phase, message } = event.data;
      // The task reports the same; an older server has no tasks.
      const reported = Object.values(state.tasks).some((each) => each.kind === "calibration");
      return phase === "failed" && !reported ? notice(state, "error", message || t`${id} failed.`, time) : {};
    }
    default:
      return null;
  }
}

/** Return the program with runs added to its history. */
export function withRuns(program: State["program"], added: Run[]): State["program"] {
  const runs = [...new Map([...program.runs, ...added].map((run) => [run.number, run])).values()].sort(
    (a, b) => b.number - a.number,
  );
  const watched = Math.max(program.watched, ...added.filter((run) => run.end === "running").map((run) => run.number));
  return { ...program, runs, watched };
}

/** Return the state of the running program; null if the event does not affect it. */
function reduceProgram(state: State, event: ServerEvent): Partial<State> | null {
  const now = state.program;
  const become = (change: Partial<typeof now>) => ({ program: { ...now, ...change } });
  switch (event.event) {
    case "PackageState": {
      const { state: next, package_id = "" } = event.data;
      if (next === "started")
        return { program: { ...NO_PROGRAM, runs: now.runs, watched: now.watched, state: next, packageId: package_id } };
      return become({
        state: next,
        packageId: package_id || now.packageId,
        running: next === "stopped" ? [] : now.running,
        position: next === "stopped" ? null : now.position,
        held: next === "pausing" || next === "paused" ? now.held : null,
      });
    }
    case "Held":
      return become({ held: event.data });
    case "HoldDecided":
      return become({ held: null });
    case "PackageInfo":
      return {
        ...open(state, { ...documentFrom(event.data.scene, event.data.project), unsaved: false, closed: true }),
        ...become({ packageId: event.data.package_id, packageName: event.data.package_name }),
        live: OFFLINE,
      };
    case "ActionStateBefore": {
      const id = event.data.action_id;
      return id ? become({ running: [...now.running.filter((each) => each !== id), id] }) : {};
    }
    case "ActionStateAfter":
      return become({ running: now.running.filter((each) => each !== event.data.action_id) });
    case "ProgramPosition":
      return become({ position: event.data });
    case "ExecutionTrace": {
      const { run, number, error, action_id } = event.data;
      const rest = now.trace.filter((each) => each.run === run && each.number !== number);
      const trace = [...rest, event.data].slice(-TRACE);
      // After a failed action there is no ActionStateAfter; an error exit may continue the program.
      return become(
        error === undefined ? { trace } : { trace, running: now.running.filter((each) => each !== action_id) },
      );
    }
    case "DryRunChanged": {
      const known = now.dryRun;
      const same = known?.dry_run.number === event.data.number ? known : null;
      if (event.data.project_id !== state.doc?.project?.id) return {};
      return become({
        dryRun: { outdated: false, stored: known?.stored ?? [], ...same, dry_run: inUserLanguage(event.data) },
      });
    }
    case "RunChanged":
      return { program: withRuns(now, [event.data]) };
    case "RunStatistics": {
      const { run: number, ...statistics } = event.data;
      return become({ runs: now.runs.map((each) => (each.number === number ? { ...each, statistics } : each)) });
    }
    default:
      return null;
  }
}
