/** Augmented reality on this device. Pictures of the camera are processed here and are not sent to the server. */

import { ArSession, openCamera, releaseCamera } from "../ar/arSession";
import { askForMotion } from "../ar/gyro";
import type { FocalLength } from "../ar/lens";
import { type Layout, layoutOf, type MarkerTable } from "../ar/places";
import type { Placement } from "../ar/placing";
import { ArProblem, type Obstacle } from "../ar/support";
import { theEngine } from "../session/engine";
import { remember, remembered } from "../session/localStorage";
import { rest } from "../session/rest";
import { now, setUi } from "../store/store";
import type { Ar } from "../store/ui";
import { endHolds } from "./holdToRun";

declare module "../store/runtime" {
  interface Runtime {
    /** The running AR view; what users see of it is `ui.ar`. */
    ar?: ArSession | undefined;
  }
}

declare global {
  interface Window {
    /** The running AR view, for tests and the browser console. */
    __ar?: ArSession | undefined;
  }
}

/** Request the configured markers. */
export async function loadMarkers(): Promise<Layout> {
  return layoutOf((await (await rest("/api/calibration/markers")).json()) as MarkerTable);
}

/**
 * Start AR; call it in a tap, since iOS asks for the motion sensor only then. Reject with ArProblem.
 *
 * @param onEnd called with the obstacle if the camera ends later.
 */
export async function startAr(layout: Layout, onEnd: (obstacle: Obstacle) => void): Promise<void> {
  leaveAr();
  await askForMotion();
  const stream = await openCamera();
  const engine = theEngine();
  if (!engine) {
    releaseCamera(stream);
    return;
  }
  const session = new ArSession(stream, {
    engine,
    layout,
    stored: (camera) => recordOf<FocalLength>("lenses")[camera] ?? null,
    store: storeLens,
    placement: (camera) => recordOf<Placement>("placements")[camera] ?? {},
    storePlacement: (camera, placement) =>
      remember("placements", JSON.stringify({ ...recordOf<Placement>("placements"), [camera]: placement })),
    report,
    ended: () => {
      leaveAr();
      onEnd("ended");
    },
  });
  use(session);
  setUi({ ar: initialAr(layout.places.size) });
  await session.start().catch(() => {
    leaveAr();
    throw new ArProblem("busy");
  });
}

/** Leave AR, stop the camera and end a held motion. `stay`: continue in the 3D view from the same viewpoint. */
export function leaveAr(stay = false): void {
  const { ar } = now().runtime;
  if (ar) endHolds();
  ar?.stop(stay);
  use(undefined);
  if (now().ui.ar) setUi({ ar: null });
}

function use(session: ArSession | undefined): void {
  now().runtime.ar = session;
  window.__ar = session;
}

export const freezeAr = (on: boolean): void => now().runtime.ar?.freeze(on);

export function recalibrateAr(): void {
  now().runtime.ar?.recalibrate();
}

/** Open or close the controls for placing; without a registration, the workplace is placed by hand from now on. */
export function openPlacing(placing: boolean): void {
  if (placing) now().runtime.ar?.placeByHand();
  report({ placing });
}

/** Forget what was placed by hand. */
export function resetPlacing(): void {
  now().runtime.ar?.resetPlacement();
  report({ placing: now().ui.ar?.phase === "registered" });
}

export const showMarkers = (markers: boolean): void => report({ markers });

function report(change: Partial<Ar>): void {
  const { ar } = now().ui;
  if (!ar) return;
  if (change.phase === "lost" && ar.phase !== "lost") endHolds();
  setUi({ ar: { ...ar, ...change } });
}

function initialAr(configured: number): Ar {
  return {
    phase: "starting",
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

/** Return what this device stores for each of its cameras. */
function recordOf<T>(key: "lenses" | "placements"): Record<string, T> {
  try {
    return (JSON.parse(remembered(key) || "{}") as Record<string, T> | null) ?? {};
  } catch {
    return {};
  }
}

function storeLens(camera: string, focal: FocalLength | null): void {
  const known = recordOf<FocalLength>("lenses");
  const before = known[camera];
  if (before?.relative === focal?.relative) return;
  const { [camera]: _, ...others } = known;
  remember("lenses", JSON.stringify(focal ? { ...others, [camera]: focal } : others));
}
