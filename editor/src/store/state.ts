/**
 * The state of the editor. Everything except `ui`, `connection` and the open function comes from the server and is
 * changed only by its events: an edit is a request, and its effect comes back as an event. Telemetry at 30 Hz is in
 * telemetry.ts.
 */

import type {
  Action,
  ActionResultData,
  BareActionPoint,
  BareProject,
  BareScene,
  ForcedPoint,
  GetDryRunData,
  HeldData,
  HistoryChangedData,
  ListProjectsData,
  ListScenesData,
  LogicItem,
  MovePreviewData,
  NamedOrientation,
  NodesData,
  ObjectAction,
  ObjectHealthData,
  ObjectStateData,
  ObjectTypeMeta,
  ObjectValuesData,
  PackageStateEnum,
  PackageSummary,
  Parameter,
  ProgramPosition,
  ProjectFunction,
  ProjectParameter,
  ProjectRobotJoints,
  ReachabilityData,
  RobotHoldData,
  RobotMeta,
  Run,
  SceneObject,
  SceneStateEnum,
  SystemInfoData,
  TaskStateData,
  TraceEntry,
  UserPresenceData,
} from "../protocol/types";
import { initialRuntime, type Runtime } from "./runtime";
import { initialUi, type Ui } from "./ui";

/** `person`: a person has to log on. `joining`: connected and loading. `lost`: reconnecting. */
type ConnectionStatus = "left" | "connecting" | "person" | "joining" | "ready" | "lost" | "refused";

export interface Connection {
  status: ConnectionStatus;
  /** Why the connection was lost or refused, as a sentence. */
  reason: string;
  /** The server refused the connection because of a missing or invalid token. */
  needsToken: boolean;
  user: string;
  /** Role from 1 to 5, given by the token and by the person who is logged on. */
  role: number;
  /** Whether persons log on at this device, the session of that person, and the idle time after which it ends, s. */
  shared: boolean;
  session: string;
  logOffAfter: number;
  server: SystemInfoData | null;
}

/** An item of an action point. */
export type OnPoint<T> = T & { pointId: string };

/** Actions and connections of the program, or of a function. */
export interface Body {
  actions: Record<string, OnPoint<Action>>;
  logic: Record<string, LogicItem>;
}

/** A function. Each of its actions is shown at the point that it uses, or at the point of the preceding action. */
export type OpenFunction = Omit<ProjectFunction, "actions" | "logic"> & Body;

/** The open scene, and the project if one is open. */
export interface OpenDocument {
  scene: BareScene;
  project: BareProject | null;
  unsaved: boolean;
  /** Whether the server has closed it for a program and opens it again afterwards. */
  closed: boolean;
  objects: Record<string, SceneObject>;
  points: Record<string, BareActionPoint>;
  orientations: Record<string, OnPoint<NamedOrientation>>;
  joints: Record<string, OnPoint<ProjectRobotJoints>>;
  /** Actions and connections of the open function, otherwise of the program. */
  actions: Record<string, OnPoint<Action>>;
  logic: Record<string, LogicItem>;
  program: Body;
  functions: Record<string, OpenFunction>;
  /** Ids of the nested open functions, outermost first; the last one is shown. Empty: the program is shown. */
  path: readonly string[];
  parameters: Record<string, ProjectParameter>;
  /** By object, then by name of the parameter. */
  overrides: Record<string, Record<string, Parameter>>;
}

export interface Lists {
  /** Null until they are loaded. */
  scenes: ListScenesData[] | null;
  projects: ListProjectsData[] | null;
  packages: PackageSummary[] | null;
  /** The list that the server suggests, and the highlighted entry. */
  shown: "ScenesList" | "ProjectsList" | "PackagesList";
  highlight: string;
}

export interface Types {
  byName: Record<string, ObjectTypeMeta>;
  robots: Record<string, RobotMeta>;
  /** Actions by type, loaded when they are needed. */
  actions: Record<string, ObjectAction[]>;
}

/** An arm of a robot with its devices; `id` is empty if the robot has one arm. */
export interface Arm {
  id: string;
  effectors: string[];
  grippers: string[];
  suctions: string[];
}

/** The last requested motion of a robot, and how it ended. */
export interface Motion {
  phase: "start" | "end" | "failed";
  /** Id of the orientation or joints that are the target; empty for other targets. */
  goal: string;
  message: string;
}

/** The online scene. */
export interface Live {
  state: SceneStateEnum;
  message: string;
  objects: Record<string, ObjectStateData>;
  health: Record<string, ObjectHealthData>;
  /** The visible state of devices, and the parts that robots carry. */
  values: Record<string, ObjectValuesData>;
  holds: Record<string, RobotHoldData>;
  /** Moving robots with the kind of motion. */
  moving: Record<string, string>;
  motions: Record<string, Motion>;
  handTeaching: Record<string, boolean>;
  /** Arms of robots that are online. */
  arms: Record<string, Arm[]>;
  /** The action that runs alone, and the result of the last one. */
  executing: string;
  result: ActionResultData | null;
}

/** The running program. */
export interface Program {
  state: PackageStateEnum;
  packageId: string;
  packageName: string;
  /** Actions that are running. */
  running: string[];
  trace: TraceEntry[];
  /** Call stacks of the program; null while they are unknown. */
  position: ProgramPosition | null;
  /** The failed action at which the program is held; null while it is not held. */
  held: HeldData | null;
  /** The run history of the server, newest first. */
  runs: Run[];
  /** The newest dry run of the open project; null if it is not known. */
  dryRun: GetDryRunData | null;
  /** Number of the newest run that was running while this page was open. */
  watched: number;
}

/** Result of an action that was run alone. */
interface SingleResult extends ActionResultData {
  time: number;
}

export interface Notice {
  id: number;
  level: "info" | "warn" | "error";
  text: string;
  time: number;
}

/** Thumbnail of a document. */
export interface Thumbnail {
  /** Data URL; empty if there is none. */
  picture: string;
  /** Whether a user chose it, so that saving does not replace it. */
  own: boolean;
}

export interface State {
  connection: Connection;
  lists: Lists;
  types: Types;
  doc: OpenDocument | null;
  /** Owners of locks by item. */
  locks: Record<string, string>;
  /** When the lock was reported, ms since 1970; older locks count from joining. */
  lockedAt: Record<string, number>;
  users: Record<string, UserPresenceData>;
  previews: Record<string, MovePreviewData>;
  history: HistoryChangedData | null;
  breakpoints: Record<string, true>;
  /** By robot, arm and end effector, then by orientation or joints. */
  reach: Record<string, ReachabilityData>;
  /**
   * View state of the open document, shared and of the user; the shared one of its scene; and the view state without a
   * document (favorites, settings).
   */
  view: Record<"user" | "shared" | "scene" | "general", Record<string, unknown>>;
  live: Live;
  program: Program;
  /** Last known values of dynamic parameters, so that they can be chosen offline too. */
  dynamicValues: Record<string, string[]>;
  /** Results of actions that were run alone, newest last. */
  singleResults: SingleResult[];
  /** Outputs that persons force, on any device. */
  forces: readonly ForcedPoint[];
  /** The computers on which devices run; null until they are known. */
  nodes: NodesData | null;
  tasks: Record<string, TaskStateData>;
  notices: Notice[];
  /** All messages since the page was opened, including dismissed ones and finished tasks; newest last. */
  messageLog: Notice[];
  /** By document, loaded when they are needed. */
  thumbnails: Record<string, Thumbnail>;
  ui: Ui;
  runtime: Runtime;
}

export const OFFLINE: Live = {
  state: "stopped",
  message: "",
  objects: {},
  health: {},
  values: {},
  holds: {},
  moving: {},
  motions: {},
  handTeaching: {},
  arms: {},
  executing: "",
  result: null,
};

export const NO_PROGRAM: Program = {
  state: "undefined",
  packageId: "",
  packageName: "",
  running: [],
  trace: [],
  position: null,
  held: null,
  runs: [],
  dryRun: null,
  watched: 0,
};

export function initialState(): State {
  return {
    connection: {
      status: "left",
      reason: "",
      needsToken: false,
      user: "",
      role: 5,
      shared: false,
      session: "",
      logOffAfter: 0,
      server: null,
    },
    lists: { scenes: null, projects: null, packages: null, shown: "ProjectsList", highlight: "" },
    types: { byName: {}, robots: {}, actions: {} },
    doc: null,
    locks: {},
    lockedAt: {},
    users: {},
    previews: {},
    history: null,
    breakpoints: {},
    reach: {},
    view: { user: {}, shared: {}, scene: {}, general: {} },
    live: OFFLINE,
    program: NO_PROGRAM,
    singleResults: [],
    forces: [],
    nodes: null,
    tasks: {},
    notices: [],
    messageLog: [],
    dynamicValues: {},
    thumbnails: {},
    runtime: initialRuntime(),
    ui: initialUi(),
  };
}
