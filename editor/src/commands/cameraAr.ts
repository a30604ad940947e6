/** AR over the picture of a camera, and what this device stores for each of its cameras. */

import { ArSession, type CameraOptions, openCamera, releaseCamera } from "../ar/arSession";
import type { FocalLength } from "../ar/lens";
import type { Placement } from "../ar/placing";
import type { Engine } from "../engine/engine";
import { remember, remembered } from "../session/localStorage";

/** Open the camera; null without a 3D view. Reject with ArProblem. */
export async function openCameraAr(
  options: Pick<CameraOptions, "layout" | "report" | "ended">,
  engine: Engine | null,
): Promise<ArSession | null> {
  const stream = await openCamera();
  if (!engine) {
    releaseCamera(stream);
    return null;
  }
  return new ArSession(stream, {
    ...options,
    engine,
    stored: (camera) => recordOf<FocalLength>("lenses")[camera] ?? null,
    store: storeLens,
    placement: (camera) => recordOf<Placement>("placements")[camera] ?? {},
    storePlacement: (camera, placement) =>
      remember("placements", JSON.stringify({ ...recordOf<Placement>("placements"), [camera]: placement })),
  });
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
