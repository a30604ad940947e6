/** Whether AR can start on this device with these markers, and why not. */

import type { Layout } from "./places";

/**
 * The reason why AR cannot start. `insecure`: the page is not trusted; `browser`: it lacks a function; `session`:
 * WebXR did not start; `overlay`: the page cannot be shown over it; the others are about the camera. With two of
 * them, AR starts, and the user places the workplace by hand: `markers`: none is configured; `dictionary`: AR does
 * not detect the configured markers.
 */
export type Obstacle =
  | "insecure"
  | "browser"
  | "markers"
  | "dictionary"
  | "refused"
  | "missing"
  | "busy"
  | "ended"
  | "session"
  | "overlay";

/** An obstacle, thrown by the start of AR. */
export class ArProblem extends Error {
  constructor(readonly obstacle: Obstacle) {
    super(obstacle);
  }
}

/** The parts of the browser that AR needs. */
interface Abilities {
  secure: boolean;
  camera: boolean;
  workers: boolean;
}

export function abilitiesOf(scope: typeof globalThis): Abilities {
  return {
    secure: scope.isSecureContext,
    camera: typeof scope.navigator?.mediaDevices?.getUserMedia === "function",
    workers: typeof scope.OffscreenCanvas === "function" && typeof scope.createImageBitmap === "function",
  };
}

/**
 * The methods by which AR locates the device. `xr`: the device tracks itself (WebXR on Android and headsets);
 * `camera`: markers in pictures of the camera.
 */
export type ArMethod = "xr" | "camera";

/** Return the methods of this device, the better one first; none if AR cannot start. */
export async function methodsOf(scope: typeof globalThis): Promise<ArMethod[]> {
  const able = abilitiesOf(scope);
  if (!able.secure) return [];
  const xr = await scope.navigator?.xr?.isSessionSupported("immersive-ar").catch(() => false);
  return [...(xr ? (["xr"] as const) : []), ...(able.camera && able.workers ? (["camera"] as const) : [])];
}

/** Return the known reason that prevents AR or registration; null if there is none. */
export function obstacleOf({ secure, camera, workers }: Abilities, layout: Layout | null): Obstacle | null {
  if (!secure) return "insecure"; // without it, browsers hide the camera
  if (!camera || !workers) return "browser";
  if (!layout) return null;
  if (!layout.supported) return "dictionary";
  return layout.places.size > 0 ? null : "markers";
}

/** Return the obstacle for an error of `getUserMedia`. */
export function obstacleOfError(error: unknown): Obstacle {
  const name = error instanceof Error ? error.name : "";
  if (name === "NotAllowedError" || name === "SecurityError") return "refused";
  return name === "NotReadableError" || name === "AbortError" ? "busy" : "missing";
}
