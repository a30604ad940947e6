/**
 * The state of the editor. Everything except `ui` and `connection` comes from the server and is changed only by its
 * events: an edit is a request, and its effect comes back as an event. Telemetry at 30 Hz is in telemetry.ts.
 */

import type {
  Action,
  ActionResultData,
  BareActionPoint,
  BareProject,
  BareScene,
  HistoryChangedData,
  Joint,
  ListProjectsData,
  ListScenesData,
  LogicItem,
  MovePreviewData,
  NamedOrientation,
  ObjectAction,
  ObjectHealthData,
  ObjectModel,
  ObjectStateData,
  ObjectTypeMeta,
  PackageStateEnum,
  PackageSummary,
  Parameter,
  Pose,
  ProjectLogicIf,
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

/** `joining`: connected and loading. `lost`: reconnecting. */
export type ConnectionStatus = "left" | "connecting" | "joining" | "ready" | "lost" | "refused";

export interface Connection {
  status: ConnectionStatus;
  /** Why it is lost or refused, as a sentence. */
  reason: string;
  user: string;
  /** Role from 1 to 5, given by the token. */
  role: number;
  server: SystemInfoData | null;
}

export type Of<T> = T & { pointId: string };

/** The open scene, and the project if one is open. */
export interface OpenDocument {
  scene: BareScene;
  project: BareProject | null;
  unsaved: boolean;
  objects: Record<string, SceneObject>;
  points: Record<string, BareActionPoint>;
  orientations: Record<string, Of<NamedOrientation>>;
  joints: Record<string, Of<ProjectRobotJoints>>;
  actions: Record<string, Of<Action>>;
  logic: Record<string, LogicItem>;
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
  /** The run history of the server, newest first. */
  runs: Run[];
  /** Number of the newest run that was running while this page was open. */
  watched: number;
}

/** Result of an action that was run alone. */
export interface Tried extends ActionResultData {
  time: number;
}

export interface Notice {
  id: number;
  level: "info" | "warn" | "error";
  text: string;
  time: number;
}

/** `terminal`: START or END of the program. */
export type Kind = "object" | "point" | "orientation" | "joints" | "action" | "logic" | "terminal";

export interface Selection {
  kind: Kind;
  id: string;
}

/** View mode of the open project. */
export type Mode = "3d" | "flow" | "split" | "code";

/** A connection in progress: the next tap ends it. */
export interface Connecting {
  from: string;
  /** Its condition; by default a free one. */
  condition?: ProjectLogicIf;
  /** The existing connection whose target is changed. */
  item?: string;
}

/** The ghost: a robot shown at another pose. */
export interface Ghost {
  robotId: string;
  joints: Joint[];
  /** Pose of its base in the world; by default that of the robot. */
  at?: Pose | undefined;
  /** Why the robot cannot reach it, as a sentence; empty if it can. */
  problem: string;
}

/** A change that has not been sent to the server: shown locally, and to others as a preview. */
export interface Draft {
  id: string;
  /** The item before the change; the next event about it ends the draft. */
  of: unknown;
  /** Pose in the frame in which it is stored. */
  pose: Pose;
  /** Its previous type, and its new shape. */
  type?: unknown;
  model?: ObjectModel;
}

export interface Ui {
  selection: Selection | null;
  /** The item at the crosshair. */
  aimed?: string | undefined;
  draft?: Draft | undefined;
  mode: Mode;
  connecting: Connecting | null;
  /** Whether the view follows the running action. */
  follow: boolean;
  ghost: Ghost | null;
  /** The open tool of the rail. */
  tool: string;
  theme: "system" | "light" | "dark";
  /** Whether the system uses a dark theme. */
  systemDark: boolean;
  leftHanded: boolean;
  quality: "auto" | "low" | "high";
  /** The dialog that is open over the screen. */
  overlay: "" | "search" | "about" | "messages";
  /** Tabs that were open last. */
  robotTab: "tool" | "joints" | "hand" | "go";
  programTab: "add" | "steps" | "problems" | "parameters";
  /** Keys of the actions and commands used last, newest first. */
  recentActions: readonly string[];
  recentCommands: readonly string[];
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
   * View state of the open document, shared and of the user, and the view state without a document (favorites,
   * settings).
   */
  view: { user: Record<string, unknown>; shared: Record<string, unknown>; general: Record<string, unknown> };
  live: Live;
  program: Program;
  /** Last known values of dynamic parameters, so that they can be chosen offline too. */
  dynamicValues: Record<string, string[]>;
  /** Results of actions that were run alone, newest last. */
  tried: Tried[];
  tasks: Record<string, TaskStateData>;
  notices: Notice[];
  /** All messages since the page was opened, including dismissed ones and finished tasks; newest last. */
  messageLog: Notice[];
  ui: Ui;
}

export const OFFLINE: Live = {
  state: "stopped",
  message: "",
  objects: {},
  health: {},
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
  runs: [],
  watched: 0,
};

export function initialState(): State {
  return {
    connection: { status: "left", reason: "", user: "", role: 5, server: null },
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
    view: { user: {}, shared: {}, general: {} },
    live: OFFLINE,
    program: NO_PROGRAM,
    tried: [],
    tasks: {},
    notices: [],
    messageLog: [],
    dynamicValues: {},
    ui: {
      selection: null,
      mode: "3d",
      connecting: null,
      follow: false,
      ghost: null,
      tool: "",
      theme: "system",
      systemDark: false,
      leftHanded: false,
      quality: "auto",
      overlay: "",
      robotTab: "tool",
      programTab: "add",
      recentActions: [],
      recentCommands: [],
    },
  };
}
