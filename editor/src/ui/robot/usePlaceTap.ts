/** While `on` is set, a tap in the view returns a position instead of selecting an item. */

import { useEffect, useRef } from "react";
import type { Position } from "../../protocol/types";
import { takeTaps } from "../../session/taps";

interface TappedPlace {
  position: Position;
  /** Outward normal; null without a surface. */
  normal: Position | null;
  /** Id of the tapped item; empty for the floor. */
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
      if (!point) return true; // nothing was hit, but the tap is still handled
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
