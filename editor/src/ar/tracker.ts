/** Processing of a picture by the worker: detect markers, register the camera, and search for the focal length. */

import { type DetectedMarker, detect } from "./detector";
import { type Grey, half } from "./grey";
import { ASSUMED, type FocalLength, KNOWN, type LensLearner, lensOf } from "./lens";
import type { Lens, Places, View } from "./pose";
import { markerErrors, type Registration, register } from "./registration";

/** The reason why no marker is found: darkness, a blurred picture, or another one. */
type Loss = "dark" | "blurred" | "unseen";

export interface Setup {
  /** Codes of the configured markers by id. */
  codes: ReadonlyMap<number, number>;
  places: Places;
  /** The focal length, if it is known. */
  focal: FocalLength | null;
}

export interface Found {
  width: number;
  height: number;
  seen: DetectedMarker[];
  registration: Registration | null;
  /** Errors of the markers, pixels, by id. */
  errors: ReadonlyMap<number, number>;
  loss: Loss | null;
  focal: FocalLength;
  /** Whether the focal length is known well enough. */
  checked: boolean;
}

/** Standard deviation of a focal length that the device states, relative. */
const STATED = 0.002;
/** Mean brightness below which a picture is too dark. */
const DARK = 35;
/** Sharpness relative to the pictures with markers, below which a picture is blurred. */
const BLURRED = 0.5;

export class Tracker {
  private focal: FocalLength;
  /** The lens of the picture, if the device states it. */
  private stated: Lens | null = null;
  private excluded: number[] = [];
  private last: View | undefined;
  /** Sharpness of the last pictures with markers. */
  private sharp = 0;

  /** `learner`: finds the focal length; without it, each picture needs its lens. */
  constructor(
    private readonly setup: Setup,
    private readonly learner?: LensLearner,
  ) {
    this.focal = setup.focal ?? ASSUMED;
  }

  /** `lens`: the lens of the picture, if it is known. */
  process(picture: Grey, lens: Lens | null = null): Found {
    const { width, height } = picture;
    this.stated = lens;
    if (lens) this.focal = { relative: lens.focal / Math.max(width, height), deviation: STATED };
    const seen = detect(picture, this.setup.codes);
    const registration = this.register(seen, width, height);
    const learned = registration && this.learner?.learn(seen, registration.view, this.focal, { width, height });
    if (!learned) return this.found(picture, seen, registration);
    const { contradicting, ...focal } = learned;
    this.focal = focal;
    this.excluded = contradicting;
    return this.found(picture, seen, this.register(seen, width, height));
  }

  private register(seen: readonly DetectedMarker[], width: number, height: number): Registration | null {
    const { deviation } = this.focal;
    const options = { deviation, known: deviation <= KNOWN, excluded: this.excluded, near: this.last };
    return register(seen, this.setup.places, this.lensOf(width, height), options);
  }

  private lensOf(width: number, height: number): Lens {
    return this.stated ?? lensOf(this.focal, width, height);
  }

  private found(picture: Grey, seen: DetectedMarker[], registration: Registration | null): Found {
    const { width, height } = picture;
    const lens = this.lensOf(width, height);
    const { light, sharpness } = registration && this.sharp > 0 ? NOT_MEASURED : lightOf(half(picture));
    if (registration) this.sharp ||= sharpness;
    this.last = registration?.view;
    return {
      width,
      height,
      seen,
      registration,
      errors: registration ? markerErrors(seen, this.setup.places, registration.view, lens) : new Map(),
      loss: registration ? null : light < DARK ? "dark" : sharpness < BLURRED * this.sharp ? "blurred" : "unseen",
      focal: this.focal,
      checked: this.focal.deviation <= KNOWN,
    };
  }
}

const NOT_MEASURED = { light: 255, sharpness: 0 };

/** Return the mean brightness, and the mean square of the differences between neighbours. */
function lightOf({ data, width, height }: Grey): { light: number; sharpness: number } {
  let [sum, squares, count] = [0, 0, 0];
  for (let y = 0; y < height; y += 4) {
    for (let x = 1; x < width; x++) {
      const value = data[y * width + x] as number;
      sum += value;
      squares += (value - (data[y * width + x - 1] as number)) ** 2;
      count++;
    }
  }
  return { light: sum / count, sharpness: squares / count };
}
