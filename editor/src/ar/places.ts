/** The configured markers of the workplace, as the server states them. */

import type { Pose } from "../protocol/types";
import { codesOf, isSupported } from "./codes";
import { add, apply, rotationOf, type Vec3 } from "./geometry";
import type { Place } from "./pose";

/** The answer of `GET /api/calibration/markers`, as far as AR needs it. */
export interface MarkerTable {
  marker_size?: number;
  dictionary?: string;
  markers?: { marker_id: number; pose: Pose; size?: number }[];
}

export interface Layout {
  codes: Map<number, number>;
  places: Map<number, Place>;
  dictionary: string;
  /** Whether AR detects markers of the dictionary. */
  supported: boolean;
}

/** Return the places of the corners of all markers that AR can detect. */
export function layoutOf({ marker_size = 0.1, dictionary = "4x4_50", markers = [] }: MarkerTable): Layout {
  const codes = codesOf(
    dictionary,
    markers.map(({ marker_id }) => marker_id),
  );
  const places = new Map<number, Place>();
  for (const { marker_id, pose, size = marker_size } of markers) {
    if (!codes.has(marker_id)) continue;
    const { x, y, z, w } = pose.orientation;
    const turn = rotationOf(x, y, z, w);
    const origin: Vec3 = [pose.position.x, pose.position.y, pose.position.z];
    const corner = (right: number, up: number) => add(apply(turn, [(right * size) / 2, (up * size) / 2, 0]), origin);
    places.set(marker_id, { corners: [corner(-1, 1), corner(1, 1), corner(1, -1), corner(-1, -1)], size });
  }
  return { codes, places, dictionary, supported: isSupported(dictionary) };
}
