/** Interface of a running AR view for the user interface, independent of how the camera is located. */

import type { Ar } from "../store/ui";
import type { Point } from "./geometry";
import type { Layout } from "./places";
import type { Direction } from "./placing";
import type { Lens, View } from "./pose";
import type { Found } from "./tracker";

/** The shown state, for the outlines of the markers and for tests. */
export interface Shown {
  found: Found;
  view: View | null;
  lens: Lens;
  /** Time from the picture to the overlay, and in the worker, ms. */
  latency: number;
  ms: number;
  /** Number of pictures. */
  count: number;
}

export interface ArMode {
  readonly mode: Ar["mode"];
  /** The configured markers. */
  readonly places: Layout["places"];
  /** The shown state; null before the first picture. */
  readonly shown: Shown | null;
  /** Called after each picture. */
  onPicture: () => void;
  /** Start; reject if the view cannot be shown. */
  start(): Promise<void>;
  /** Release camera and session. `stay`: keep the viewpoint instead of returning to the one before. */
  stop(stay?: boolean): void;
  /** Keep the picture and the pose, or continue. */
  freeze(on: boolean): void;
  /** Forget how the workplace was registered. */
  recalibrate(): void;
  /** Place the workplace by hand until markers register it, unless they do so now. */
  placeByHand(): void;
  /** Move the workplace with the fingers from points of the 3D view to others, pixels. */
  drag(from: readonly Point[], to: readonly Point[]): void;
  /** Move the workplace by a distance, m, or an angle, rad. */
  step(direction: Direction, size: { distance: number; angle: number }): void;
  /** Tilt the camera of a view that was placed by hand upwards, rad. */
  tilt(angle: number): void;
  /** Store what was placed by hand on this device. */
  keepPlacement(): void;
  /** Forget what was placed by hand. */
  resetPlacement(): void;
  /** Return the point of the 3D view, pixels, at a point of the picture. */
  onScreen(point: Point): Point;
}
