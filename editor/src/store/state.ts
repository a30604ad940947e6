/**
 * What the editor knows, by subject. All but `ui` and `connection` comes from the server; nothing of that is changed
 * here on the user's word: an edit is a request, and what it does comes back as an event.
 *
 * What moves at 30 Hz is not here but in telemetry.ts.
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

/** `joining`: connected, being let in and told what there is. `lost`: was there and is being looked for. */
export type ConnectionStatus = "left" | "connecting" | "joining" | "ready" | "lost" | "refused";

export interface Connection {
  status: ConnectionStatus;
  /** Why it is lost or refused, as a sentence. */
  reason: string;
  user: string;
  /** 1 to 5; the server says it by refusing, and by the token. */
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
  /** By object, by the parameter's name. */
  overrides: Record<string, Record<string, Parameter>>;
}

export interface Lists {
  /** null until they are known. */
  scenes: ListScenesData[] | null;
  projects: ListProjectsData[] | null;
  packages: PackageSummary[] | null;
  /** Which of the lists the server would show, and what in it. */
  shown: "ScenesList" | "ProjectsList" | "PackagesList";
  highlight: string;
}

export interface Types {
  byName: Record<string, ObjectTypeMeta>;
  robots: Record<string, RobotMeta>;
  /** Actions by type, asked for when they are first needed. */
  actions: Record<string, ObjectAction[]>;
}

/** An arm of a robot, with what is on it; `id` is empty where the robot has one arm. */
export interface Arm {
  id: string;
  effectors: string[];
  grippers: string[];
  suctions: string[];
}

/** The last motion that was asked of a robot, and how it ended. */
export interface Motion {
  phase: "start" | "end" | "failed";
  /** Id of the orientation or joints it leads to; empty for another goal. */
  goal: string;
  message: string;
}

/** The scene in operation. */
export interface Live {
  state: SceneStateEnum;
  message: string;
  objects: Record<string, ObjectStateData>;
  health: Record<string, ObjectHealthData>;
  holds: Record<string, RobotHoldData>;
  /** Robots that move, with what they are doing. */
  moving: Record<string, string>;
  motions: Record<string, Motion>;
  handTeaching: Record<string, boolean>;
  /** Of robots that are online; asked for when they come. */
  arms: Record<string, Arm[]>;
  /** The action that is tried out, and how the last one ended. */
  executing: string;
  result: ActionResultData | null;
}

/** The program in operation. */
export interface Program {
  state: PackageStateEnum;
  packageId: string;
  packageName: string;
  /** Actions that run now. */
  running: string[];
  trace: TraceEntry[];
  /** The run history of the server, newest first. */
  runs: Run[];
  /** Number of the newest run that was running while this page was open. */
  watched: number;
}

/** How an action that was tried by itself ended. */
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

/** How the open project is looked at. */
export type Mode = "3d" | "flow" | "split" | "code";

/** A step that is being drawn: the next tap says where it leads. */
export interface Connecting {
  from: string;
  /** When it is to be taken; left out: what is still free. */
  condition?: ProjectLogicIf;
  /** The step whose end is moved, instead of a new one. */
  item?: string;
}

/** A robot shown where it would be, beside where it is. */
export interface Ghost {
  robotId: string;
  joints: Joint[];
  /** Where its base stands, in the world; left out: where the robot's own does. */
  at?: Pose | undefined;
  /** What is wrong with it, as a sentence; empty when it can go there. */
  problem: string;
}

/** What the user does to a thing and has not told the server yet: shown by him, and to others as a preview. */
export interface Draft {
  id: string;
  /** The thing as it was: with the next event about it the draft is over. */
  of: unknown;
  /** In the frame in which it is stored. */
  pose: Pose;
  /** Its type as it was, and the shape that it is to have. */
  type?: unknown;
  model?: ObjectModel;
}

export interface Ui {
  selection: Selection | null;
  /** What is at the cross, where the user picks by it. */
  aimed?: string | undefined;
  draft?: Draft | undefined;
  mode: Mode;
  connecting: Connecting | null;
  /** The view goes where the program is. */
  follow: boolean;
  ghost: Ghost | null;
  /** The tool of the left rail that is open. */
  tool: string;
  theme: "system" | "light" | "dark";
  /** The device asks for dark colours. */
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
  /** Owners by what they hold. */
  locks: Record<string, string>;
  /** When it was heard that they do, as `Date.now()`: what was held before this user came, since he came. */
  lockedAt: Record<string, number>;
  users: Record<string, UserPresenceData>;
  previews: Record<string, MovePreviewData>;
  history: HistoryChangedData | null;
  breakpoints: Record<string, true>;
  /** By robot, arm and end effector, then by orientation or joints. */
  reach: Record<string, ReachabilityData>;
  /** Shared and own view state of the open document, and of none (stars, settings). */
  view: { user: Record<string, unknown>; shared: Record<string, unknown>; general: Record<string, unknown> };
  live: Live;
  program: Program;
  /** Last known values of dynamic parameters, so that they can be chosen offline too. */
  dynamicValues: Record<string, string[]>;
  /** Results of actions that were run alone, newest last. */
  tried: Tried[];
  tasks: Record<string, TaskStateData>;
  notices: Notice[];
  /** All that was told since the page is open, also what is dismissed and work that is over; the newest last. */
  said: Notice[];
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
    said: [],
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
