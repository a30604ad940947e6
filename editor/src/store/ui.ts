/** The state of the screen: what the user selects, changes and sees. Other users and the server do not share it. */

import type { Joint, ObjectModel, Pose, Position, ProjectLogicIf } from "../protocol/types";

/** `terminal`: START or END of the program. */
export type Kind = "object" | "point" | "orientation" | "joints" | "action" | "logic" | "terminal";

export interface Selection {
  kind: Kind;
  id: string;
}

/** View mode of the open project. */
export type Mode = "3d" | "flow" | "split" | "code";

/** A connection that is being drawn: the next tap selects its target. */
export interface Connecting {
  from: string;
  /** Condition of the connection; by default one that no other connection uses. */
  condition?: ProjectLogicIf;
  /** The existing connection whose target is changed. */
  item?: string;
  /** Whether it becomes an error exit. */
  error?: boolean;
}

/** The ghost: a robot shown at another pose. */
export interface Ghost {
  robotId: string;
  joints: Joint[];
  /** Pose of its base in the world; by default that of the robot. */
  at?: Pose | undefined;
  /** The reason why the robot cannot reach it, a sentence; empty if it can. */
  problem: string;
}

/** A change that has not been sent to the server: shown locally, and to others as a preview. */
export interface Draft {
  id: string;
  /** The item before the change; the next event about it ends the draft. */
  of: unknown;
  /** Pose in the frame in which it is stored. */
  pose: Pose;
  /** The type of a resized item before the change, and its new shape. */
  type?: unknown;
  model?: ObjectModel;
  /** Whether the user is still changing it, so that events about the item do not end the draft. */
  continues?: boolean;
}

/** The crosshair in the middle of the view. */
export interface Crosshair {
  /** Whether a list of the candidates is open. */
  listed: boolean;
  /** Ids, most likely first. */
  candidates: string[];
  chosen: string;
}

/** Options of a motion; `speed` is relative to the maximum of the robot. */
export interface MotionOptions {
  speed: number;
  safe: boolean;
  linear: boolean;
}

/** How the user moves robots. */
export interface Jogging extends MotionOptions {
  /** `selected`: the frame of the selected item. */
  frame: "world" | "robot" | "tool" | "selected";
  /** Step per press, or hold to move. */
  press: "step" | "hold";
  what: "position" | "orientation";
  /** Step sizes, m and rad. */
  distance: number;
  angle: number;
}

/** A running measurement of an object by its focus points. It continues while other panels are open. */
interface Measurement {
  objectId: string;
  /** Numbers of the recorded points. */
  recorded: readonly number[];
  /** Tool positions at the recorded points, for the preview of the fit. */
  touched: Record<number, Position>;
  /** Null until there are enough points. */
  fit: Fit | null;
}

/** The fit of the touched points to the known points. */
export interface Fit {
  /** Whether there are enough points for the errors to be meaningful. */
  checked: boolean;
  /** Root mean square of the errors, and the largest one, m. */
  rms: number;
  worst: number;
  worstPoint: number;
}

/** A form that is not saved: name and node of a new object, and JSON of each setting that differs from its default. */
export interface FormDraft {
  name?: string;
  node?: string;
  values: Record<string, string>;
}

/** An edited script that is not imported. */
export interface ScriptDraft {
  projectId: string;
  /** The script before, and the revision of the project from which it was generated. */
  script: string;
  revision: number;
  text: string;
}

/** Augmented reality: the picture of the camera behind the 3D view. */
export interface Ar {
  /**
   * `looking`: no marker was seen yet; `bridging`: the orientation sensor replaces the markers for a moment; `hand`:
   * the user placed the workplace by hand; `tracked`: it was registered, and the device tracks itself since.
   */
  phase: "starting" | "looking" | "registered" | "bridging" | "tracked" | "lost" | "hand";
  /** `camera`: the picture of the camera behind the 3D view; the others with WebXR: the page over it, or in space. */
  mode: "camera" | "tablet" | "headset";
  /** Whether pictures of the camera are available, for markers and to freeze them. */
  pictures: boolean;
  /** Whether a device that tracks itself has moved so far that a visible drift is expected. */
  drifted: boolean;
  /** Number of touched points that registered the workplace; 0 if it was registered otherwise. */
  touched: number;
  /** Whether Stop is on a button of a tracked controller. */
  stopButton: boolean;
  /** Picture and pose are frozen. */
  frozen: boolean;
  /** Whether the outlines of the markers are shown. */
  markers: boolean;
  /** The last registration. */
  grade: "good" | "fair" | "rough";
  /** Expected error of the overlay, m. */
  error: number;
  used: readonly number[];
  contradicting: readonly number[];
  /** Two markers contradict each other. */
  undecided: boolean;
  /** Whether the focal length of the camera is known. */
  checked: boolean;
  /** Time of the last registration, ms since the epoch. */
  seenAt: number;
  /** Why no marker is found. */
  loss: "dark" | "blurred" | "unseen";
  /** Distance by which the last correction moved the overlay, m, if it was visible; 0 otherwise. */
  corrected: number;
  /** Number of configured markers. */
  configured: number;
  /** Whether the device has an orientation sensor. */
  sensor: boolean;
  /** Offset by which the user moved the overlay away from its pose by markers, m and rad. */
  nudge: { distance: number; angle: number } | null;
  /** Whether the controls for placing are open. */
  placing: boolean;
  /** The pose of the camera that other users see; null while it is unknown. */
  camera: Pose | null;
  startedAt: number;
}

export interface Ui {
  selection: Selection | null;
  /** The item at the crosshair. */
  aimed?: string | undefined;
  draft?: Draft | undefined;
  mode: Mode;
  connecting: Connecting | null;
  /** Actions that are being selected for a function; null unless several are selected. */
  picked: readonly string[] | null;
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
  /** Step of the guided tour; null while it is closed. */
  tour: number | null;
  /** The dialog that is open over the screen. */
  overlay: "" | "search" | "about" | "messages" | "audit" | "interlocks" | "persons" | "pin" | "production" | "cell";
  /** Settings as typed, by the id of the object or, for a new device, by the name of its type. */
  forms: Record<string, FormDraft>;
  scriptDraft?: ScriptDraft | undefined;
  /** Tabs that were open last. */
  robotTab: "tool" | "joints" | "hand" | "go";
  programTab: "add" | "steps" | "problems" | "parameters";
  crosshair: Crosshair;
  /** Null while AR is off. */
  ar: Ar | null;
  jogging: Jogging;
  measurement: Measurement | null;
  /** Pose of the last calibrated object before the calibration, until the user accepts or reverts the new one. */
  beforeCalibration: { id: string; pose: Pose } | null;
  /** Keys of the actions and commands used last, newest first. */
  recentActions: readonly string[];
  recentCommands: readonly string[];
}

export function initialUi(): Ui {
  return {
    selection: null,
    mode: "3d",
    connecting: null,
    picked: null,
    follow: false,
    ghost: null,
    tool: "",
    theme: "system",
    systemDark: false,
    leftHanded: false,
    quality: "auto",
    overlay: "",
    tour: null,
    forms: {},
    robotTab: "tool",
    programTab: "add",
    recentActions: [],
    recentCommands: [],
    crosshair: { listed: false, candidates: [], chosen: "" },
    ar: null,
    jogging: {
      frame: "world",
      press: "step",
      what: "position",
      distance: 0.01,
      angle: 5 * (Math.PI / 180),
      speed: 0.25,
      safe: true,
      linear: true,
    },
    measurement: null,
    beforeCalibration: null,
  };
}
