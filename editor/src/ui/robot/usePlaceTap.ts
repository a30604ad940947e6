/** While it is on, the next tap in the view gives a place instead of selecting. */

import { useEffect, useRef } from "react";
import type { Position } from "../../protocol/types";
import { takeTaps } from "../../session/taps";

export interface TappedPlace {
  position: Position;
  /** Out of the surface; null where there is none. */
  normal: Position | null;
  /** What was tapped; empty for the floor. */
  id: string;
}

export function usePlaceTap(on: boolean, onPlace: (place: TappedPlace) => void): void {
  const latest = useRef(onPlace);
  latest.current = onPlace;
  useEffect(() => {
    if (!on) return;
    return takeTaps((hits, floor) => {
      const hit = hits.find((each) => each.normal !== null);
      const point = hit?.point ?? floor;
      if (!point) return true; // the sky: it asks for a place, so nothing else is meant
      const normal = hit?.normal ?? (hit ? null : { x: 0, y: 0, z: 1 });
      latest.current({
        position: { x: point.x, y: point.y, z: point.z },
        normal: normal && { x: normal.x, y: normal.y, z: normal.z },
        id: hit?.id ?? "",
      });
      return true;
    });
  }, [on]);
}
