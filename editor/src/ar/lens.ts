/**
 * The focal length of a camera, found from several views of the markers. A wrong one is not visible between the
 * markers, but next to them: 3 % are 12 mm at a distance of 0.4 m.
 */

import type { DetectedMarker } from "./detector";
import { dot, norm, sub, type Vec3 } from "./geometry";
import { eyeOf, fitView, type Lens, markerError, type Place, type Places, type View } from "./pose";

/** A focal length relative to the longer side of the picture, and its standard deviation relative to itself. */
export interface FocalLength {
  relative: number;
  deviation: number;
}

/** A common camera of a tablet: 66° along the longer side. */
export const ASSUMED: FocalLength = { relative: 0.77, deviation: 0.1 };
/** Largest deviation with which the focal length counts as known. */
export const KNOWN = 0.004;
/** Smallest deviation that is stated: distortion is not measured. */
const FINEST = 0.001;
/** Range of the search, relative to the longer side: 100° to 20°. */
const RANGE = [0.42, 2.8] as const;
const STEPS = 24;
const GOLDEN = (Math.sqrt(5) - 1) / 2;
/** Largest number of views, and the smallest number for an answer. */
const MOST = 10;
const FEWEST = 3;
/** Views differ if their directions differ by this angle, rad, or their distances by this factor. */
const TURNED = 0.1;
const MOVED = 1.15;
/** Largest error of a view, pixels, for a picture with this longer side. */
const WORST = 1.2 / 1280;

/** Return the lens of a picture. */
export const lensOf = ({ relative }: FocalLength, width: number, height: number): Lens => ({
  focal: relative * Math.max(width, height),
  cx: (width - 1) / 2,
  cy: (height - 1) / 2,
});

type Learned = FocalLength & { contradicting: number[] };
interface Size {
  width: number;
  height: number;
}

interface Shot {
  seen: readonly DetectedMarker[];
  eye: Vec3;
  direction: Vec3;
}

/** Learns the focal length while the camera moves. */
export class LensLearner {
  private search: LensSearch | null = null;
  private size = "";

  constructor(private readonly places: Places) {}

  /** Use a view. Return a better focal length, and the markers that contradict the others; null if there is none. */
  learn(seen: readonly DetectedMarker[], view: View, before: FocalLength, { width, height }: Size): Learned | null {
    const size = `${Math.max(width, height)} × ${Math.min(width, height)}`;
    if (size !== this.size || !this.search) {
      this.size = size;
      this.search = new LensSearch(this.places, width, height);
    }
    if (before.deviation <= KNOWN || !this.search.add(seen, view)) return null;
    const result = this.search.result();
    return result && result.deviation < before.deviation ? result : null;
  }
}

/** Collects different views, and searches for the focal length that fits to all of them. */
class LensSearch {
  private shots: Shot[] = [];

  constructor(
    private readonly places: Places,
    private readonly width: number,
    private readonly height: number,
  ) {}

  /** Add a view if it differs from the others. Return whether it does. */
  add(seen: readonly DetectedMarker[], view: View): boolean {
    const known = seen.filter(({ id }) => this.places.has(id));
    if (known.length < 2) return false;
    const eye = eyeOf(view);
    const direction = view.turn[2];
    const differs = this.shots.every(({ eye: other, direction: otherDirection }) => {
      const factor = norm(eye) / Math.max(1e-6, norm(other));
      return (
        Math.acos(Math.min(1, dot(direction, otherDirection))) > TURNED ||
        Math.max(factor, 1 / factor) > MOVED ||
        norm(sub(eye, other)) > 0.15
      );
    });
    if (!differs) return false;
    this.shots = [...this.shots, { seen: known, eye, direction }].slice(-MOST);
    return true;
  }

  /**
   * Return the focal length, and the markers that contradict the others; null as long as it is not determined. A
   * marker contradicts if all views fit without it and not with it.
   */
  result(): Learned | null {
    if (this.shots.length < FEWEST) return null;
    const limit = WORST * Math.max(this.width, this.height);
    const all = this.search(this.places);
    if (all && all.rms <= limit) return { ...all, contradicting: [] };
    const ids = [...new Set(this.shots.flatMap(({ seen }) => seen.map(({ id }) => id)))];
    if (ids.length < 3) return null;
    const without = ids
      .map((id) => ({ id, found: this.search(new Map([...this.places].filter(([other]) => other !== id))) }))
      .filter(({ found }) => found !== null && found.rms <= limit)
      .sort((a, b) => (a.found?.rms ?? 0) - (b.found?.rms ?? 0));
    const [best] = without;
    return best?.found ? { ...best.found, contradicting: [best.id] } : null;
  }

  private search(places: Places): (FocalLength & { rms: number }) | null {
    const shots = this.shots
      .map(({ seen }) => seen.filter(({ id }) => places.has(id)))
      .filter((seen) => seen.length >= 2);
    if (shots.length < FEWEST) return null;
    const cost = (logarithm: number) => this.cost(shots, places, Math.exp(logarithm));
    const best = minimum(cost, Math.log(RANGE[0]), Math.log(RANGE[1]));
    const corners = 4 * shots.reduce((sum, seen) => sum + seen.length, 0);
    const least = cost(best);
    const step = 0.02;
    const curvature = (cost(best + step) + cost(best - step) - 2 * least) / step ** 2;
    const variance = Math.max(0.05 ** 2, least / (2 * corners - 6 * shots.length - 1));
    const deviation = curvature > 0 ? Math.sqrt((2 * variance) / curvature) : 1;
    return {
      relative: Math.exp(best),
      deviation: Math.max(FINEST, deviation),
      rms: Math.sqrt(least / corners),
    };
  }

  /** Return the squared errors of all corners for a focal length, pixels². */
  private cost(shots: readonly DetectedMarker[][], places: Places, relative: number): number {
    const lens = lensOf({ relative, deviation: 0 }, this.width, this.height);
    let sum = 0;
    for (const seen of shots) {
      const view = fitView(seen, places, lens);
      if (!view) return Number.POSITIVE_INFINITY;
      for (const each of seen) sum += markerError(each, places.get(each.id) as Place, view, lens);
    }
    return sum;
  }
}

/** Return the minimum of a function with one minimum by golden-section search. */
function minimum(cost: (x: number) => number, from: number, to: number): number {
  let [a, b] = [from, to];
  let [c, d] = [b - GOLDEN * (b - a), a + GOLDEN * (b - a)];
  let [low, high] = [cost(c), cost(d)];
  for (let step = 0; step < STEPS; step++) {
    if (low < high) {
      [b, d, high] = [d, c, low];
      c = b - GOLDEN * (b - a);
      low = cost(c);
    } else {
      [a, c, low] = [c, d, high];
      d = a + GOLDEN * (b - a);
      high = cost(d);
    }
  }
  return (a + b) / 2;
}
