/** The pose of the camera in the workplace from what one picture shows, with its quality. */

import type { DetectedMarker } from "./detector";
import { add, apply, mean, norm, solve, sub, type Vec3 } from "./geometry";
import {
  dependence,
  type FittedView,
  fitView,
  type Lens,
  markerError,
  type Place,
  type Places,
  type View,
} from "./pose";

/** Good enough to place things, to check them, or only to recognise them. */
export type Grade = "good" | "fair" | "rough";

export interface Registration {
  view: View;
  /** Markers that were used. */
  used: number[];
  /** Markers that contradict the others and were not used. */
  contradicting: number[];
  /** Two markers contradict each other. The misplaced one cannot be found. */
  undecided: boolean;
  /** Expected error of the overlay 0.5 m from the markers, m. */
  error: number;
  grade: Grade;
}

/** Largest error of markers whose places are right, relative to their distance: 1.8 mm at 1 m. */
const MISPLACED = 0.0018;
/** The same without a known focal length. */
const MISPLACED_UNCHECKED = 0.015;
/** Error of the second view above which it is not possible, relative to that of the best one. */
const CLEAR = 0.5;
/** Smallest standard deviation of a corner, pixels. */
const FINEST = 0.1;
/** Places of markers are measured with a ruler, m. */
const PLACING = 0.001;
/** Distance from the markers for which the error is stated, m. */
export const ASIDE = 0.5;
/** Limits of the grades, m. */
export const GOOD = 0.004;
export const FAIR = 0.012;
/** Jump after which the overlay was visibly wrong, m. */
export const JUMP = 0.01;

/** The known state before a picture is analysed. */
interface Knowledge {
  /** Standard deviation of the focal length, relative, and whether the focal length counts as known. */
  deviation: number;
  known: boolean;
  /** Markers that are known to be misplaced. */
  excluded?: readonly number[];
  /** A recent view, which decides between two views that a marker permits. */
  near?: View | undefined;
}

/** Return the registration by the markers of a picture; null without a configured marker. */
export function register(
  seen: readonly DetectedMarker[],
  places: Places,
  lens: Lens,
  { deviation, known, excluded = [], near }: Knowledge,
): Registration | null {
  const configured = seen.filter(({ id }) => places.has(id));
  const contradicting = configured.filter(({ id }) => excluded.includes(id)).map(({ id }) => id);
  let used = configured.filter(({ id }) => !contradicting.includes(id));
  let view = fitView(used, places, lens);
  if (!view) return null;
  const ambiguous = used.length === 1 && view.ambiguity > CLEAR;
  if (ambiguous && near) view = fitView(used, places, lens, near) ?? view;
  const limit = (known ? MISPLACED : MISPLACED_UNCHECKED) * lens.focal;
  while (used.length > 2 && view.rms > limit) {
    const best = withoutOne(used, places, lens);
    if (!best || best.view.rms > view.rms / 2) break;
    contradicting.push(best.id);
    used = used.filter(({ id }) => id !== best.id);
    view = best.view;
  }
  const undecided = view.rms > limit;
  const error = Math.hypot(overlayError(used, places, lens, view), PLACING, deviation * ASIDE);
  const grade = ambiguous || undecided || error > FAIR ? "rough" : error > GOOD || used.length < 2 ? "fair" : "good";
  return { view, used: used.map(({ id }) => id), contradicting, undecided, error, grade };
}

/** Leave out the marker without which the others fit best. */
function withoutOne(
  used: readonly DetectedMarker[],
  places: Places,
  lens: Lens,
): { id: number; view: FittedView } | null {
  const found = used
    .map(({ id }) => ({
      id,
      view: fitView(
        used.filter((other) => other.id !== id),
        places,
        lens,
      ),
    }))
    .filter((each): each is { id: number; view: FittedView } => each.view !== null)
    .sort((a, b) => a.view.rms - b.view.rms);
  return found[0] ?? null;
}

/** Return the standard deviation of the overlay 0.5 m from the markers, m: the largest one of five directions. */
function overlayError(used: readonly DetectedMarker[], places: Places, lens: Lens, view: FittedView): number {
  const count = 2 * view.corners;
  const variance = Math.max(FINEST ** 2, (view.rms ** 2 * view.corners) / Math.max(1, count - 6));
  const middle = mean(used.map(({ id }) => mean((places.get(id) as Place).corners)));
  const around: Vec3[] = [
    [1, 0, 0],
    [-1, 0, 0],
    [0, 1, 0],
    [0, -1, 0],
    [0, 0, 1],
  ];
  let worst = 0;
  for (const direction of around) {
    const point = add(middle, [direction[0] * ASIDE, direction[1] * ASIDE, direction[2] * ASIDE]);
    const depth = add(apply(view.turn, point), view.shift)[2];
    if (depth < 0.1) continue;
    let sum = 0;
    for (const row of dependence(point, view, lens)) {
      const covariance = solve(view.information, row);
      if (!covariance) return Number.POSITIVE_INFINITY;
      sum += row.reduce((total, value, i) => total + value * (covariance[i] as number), 0) * variance;
    }
    worst = Math.max(worst, (Math.sqrt(sum) * depth) / lens.focal);
  }
  return worst;
}

/** Return how far the overlay moves between two views at the given points, m: the largest movement. */
export function jumpBetween(before: View, after: View, points: readonly Vec3[]): number {
  return Math.max(
    0,
    ...points.map((point) => {
      const a = add(apply(before.turn, point), before.shift);
      const b = add(apply(after.turn, point), after.shift);
      return norm(sub(a, b));
    }),
  );
}

/** Return the root mean square error of each marker, pixels, for the diagnostics. */
export function markerErrors(
  seen: readonly DetectedMarker[],
  places: Places,
  view: View,
  lens: Lens,
): Map<number, number> {
  const errors = new Map<number, number>();
  for (const each of seen) {
    const place = places.get(each.id);
    if (place) errors.set(each.id, Math.sqrt(markerError(each, place, view, lens) / 4));
  }
  return errors;
}
