/** Augmented reality on this device. Pictures of the camera are processed here and are not sent to the server. */

import type { Vector3 } from "three";
import type { Grab } from "../ar/headset";
import type { ArMode } from "../ar/mode";
import { askForMotion } from "../ar/motionSensor";
import { type Layout, layoutOf, type MarkerTable } from "../ar/places";
import { type ArMethod, ArProblem, type Obstacle, obstacleOfError } from "../ar/support";
import type { XrArSession } from "../ar/xrSession";
import type { Engine } from "../engine/engine";
import { theEngine } from "../session/engine";
import { rest } from "../session/rest";
import { getState, setUi } from "../store/store";
import type { Ar } from "../store/ui";
import { notMovable, targetOf } from "../transform/target";
import { plus } from "../viewmodel/frames";
import { stopHoldToRun } from "./holdToRun";
import { beginMove } from "./move";
import { stopMotion } from "./operation";

declare module "../store/runtime" {
  interface Runtime {
    /** The running AR view; what users see of it is `ui.ar`. */
    ar?: ArMode | undefined;
    /** The program that was started or continued from this headset, and whether Stop went out of reach since. */
    startedHere?: { lost: boolean } | undefined;
  }
}

declare global {
  interface Window {
    /** The running AR view, for tests and the browser console. */
    __ar?: ArMode | undefined;
  }
}

/** Request the configured markers. */
export async function loadMarkers(): Promise<Layout> {
  return layoutOf((await (await rest("/api/calibration/markers")).json()) as MarkerTable);
}

/**
 * Start AR; call it in a tap, since browsers ask for the camera and the motion sensor only then. Reject with ArProblem.
 *
 * @param onEnd called with the obstacle if AR ends unexpectedly.
 */
export async function startAr(layout: Layout, method: ArMethod, onEnd: (obstacle: Obstacle) => void): Promise<void> {
  leaveAr();
  const engine = theEngine();
  const ended = () => {
    if (getState().ui.ar?.mode === "headset") stopOutOfReach();
    leaveAr();
    onEnd("ended");
  };
  const mode = method === "xr" ? await xrMode(layout, engine, ended) : await cameraMode(layout, engine, ended);
  if (!mode) return;
  setArMode(mode);
  setUi({ ar: initialAr(mode.mode, layout.places.size) });
  await mode.start().catch(() => {
    leaveAr();
    throw new ArProblem(method === "xr" ? "session" : "busy");
  });
}

async function cameraMode(layout: Layout, engine: Engine | null, ended: () => void): Promise<ArMode | null> {
  await askForMotion();
  const { openCameraAr } = await loadMethod("camera");
  return openCameraAr({ layout, report, ended }, engine);
}

const LOADS = { xr: () => import("../ar/xrSession"), camera: () => import("./cameraAr") };

/** Load the code of an AR mode before the tap that starts it, because browsers ask for the camera only during a tap. */
export const loadMethod = <M extends ArMethod>(method: M): ReturnType<(typeof LOADS)[M]> =>
  LOADS[method]() as ReturnType<(typeof LOADS)[M]>;

async function xrMode(layout: Layout, engine: Engine | null, ended: () => void): Promise<ArMode | null> {
  if (!engine) return null;
  const { hasOverlay, requestXr, XrArSession } = await loadMethod("xr");
  const session = await requestXr().catch((error: unknown) => {
    throw new ArProblem(obstacleOfError(error) === "refused" ? "refused" : "session");
  });
  // On the screen of a tablet, there are no controls without the page.
  if (!hasOverlay(session) && session.interactionMode === "screen-space") {
    await session.end();
    throw new ArProblem("overlay");
  }
  return new XrArSession(session, {
    engine,
    layout,
    report,
    ended,
    release: stopHoldToRun,
    stopMotion: () => void stopMotion(),
    stopOutOfReach,
    grab,
  });
}

/** Handle that no stop button of a headset is available: stop hold-to-run and the program started from this headset. */
function stopOutOfReach(): void {
  const { runtime } = getState();
  stopHoldToRun();
  if (!runtime.startedHere) return;
  runtime.startedHere.lost = true;
  runtime.startedHere = undefined;
  void stopMotion();
}

/** Start or continue the program from a headset; it runs only while a controller with a stop button is connected. */
export async function startHere(start: () => Promise<unknown>): Promise<void> {
  const { runtime } = getState();
  const program = { lost: false };
  runtime.startedHere = program;
  const started = await start();
  if (started === false) runtime.startedHere = undefined;
  else if (program.lost) void stopMotion(); // Stop went out of reach before the program had started
}

/** The program has ended; the next one may be started elsewhere. */
export function programEnded(): void {
  getState().runtime.startedHere = undefined;
}

/** Move the selected item with a ray. `from`: the grabbed point, m. */
function grab(id: string, from: Vector3): Grab | null {
  const state = getState();
  const target = state.ui.selection?.id === id ? targetOf(state, state.ui.selection) : null;
  if (!target?.moves || notMovable(state, target)) return null;
  const one = beginMove(target);
  const { position, orientation } = target.pose;
  return {
    to: (at) => {
      const shift = { x: at.x - from.x, y: at.y - from.y, z: at.z - from.z };
      one.moveTo({ position: plus(position, shift), orientation });
    },
    end: () => one.finish(),
  };
}

/** Leave AR, stop the camera and hold-to-run. `stay`: continue in the 3D view from the same viewpoint. */
export function leaveAr(stay = false): void {
  const { ar } = getState().runtime;
  if (ar) stopHoldToRun();
  ar?.stop(stay);
  getState().runtime.startedHere = undefined; // Stop is on the page again
  setArMode(undefined);
  if (getState().ui.ar) setUi({ ar: null });
}

function setArMode(session: ArMode | undefined): void {
  getState().runtime.ar = session;
  window.__ar = session;
}

export const freezeAr = (on: boolean): void => getState().runtime.ar?.freeze(on);

export function recalibrateAr(): void {
  getState().runtime.ar?.recalibrate();
}

/** Return the running AR view of a headset or tablet that tracks itself. */
export function xrView(): XrArSession | null {
  const { ar } = getState().runtime;
  return ar && "registerTouched" in ar ? (ar as XrArSession) : null;
}

/** Open or close the controls for placing; without a registration, the workplace is placed by hand from now on. */
export function openPlacing(placing: boolean): void {
  if (placing) getState().runtime.ar?.placeByHand();
  report({ placing });
}

/** Forget what was placed by hand. */
export function resetPlacing(): void {
  getState().runtime.ar?.resetPlacement();
  report({ placing: getState().ui.ar?.phase === "registered" });
}

export const showMarkers = (markers: boolean): void => report({ markers });

function report(change: Partial<Ar>): void {
  const { ar } = getState().ui;
  if (!ar) return;
  if (change.phase === "lost" && ar.phase !== "lost") stopHoldToRun();
  setUi({ ar: { ...ar, ...change } });
}

function initialAr(mode: Ar["mode"], configured: number): Ar {
  return {
    phase: "starting",
    mode,
    pictures: true,
    drifted: false,
    touched: 0,
    stopButton: false,
    frozen: false,
    markers: false,
    grade: "rough",
    error: 0,
    used: [],
    contradicting: [],
    undecided: false,
    checked: false,
    seenAt: 0,
    loss: "unseen",
    corrected: 0,
    configured,
    sensor: false,
    nudge: null,
    placing: false,
    camera: null,
    startedAt: Date.now(),
  };
}
