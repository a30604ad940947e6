/** Registration by touched points, with the instructions for the user of a headset. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { fitTouched, type KnownPoint, knownPoints, type TouchFit } from "../../ar/touch";
import type { XrArSession } from "../../ar/xrSession";

const CORNERS: readonly MessageDescriptor[] = [
  msg`upper left corner`,
  msg`upper right corner`,
  msg`lower right corner`,
  msg`lower left corner`,
];

/** Let the user touch the known points. `show` shows instructions; `end` is called with why it failed, or "". */
export function touchPoints(
  view: XrArSession,
  show: (instruction: string) => void,
  end: (failure: string) => void,
): void {
  const known = knownPoints(view.places);
  const next = (number: number) => {
    const point = nameOf(known[number]);
    show(t`Touch ${number + 1} of ${known.length}: ${point}. Hold still while you press.`);
  };
  const done = (points: readonly KnownPoint["at"][]) => {
    const result = fitTouched(
      known.map(({ at }) => at),
      points,
    );
    if ("workplace" in result) view.registerTouched(result);
    end(failureOf(result, known));
  };
  view.headset?.touch({ known, next, done });
  next(0);
}

function nameOf({ marker, corner }: Pick<KnownPoint, "marker" | "corner"> = { marker: 0, corner: 0 }): string {
  return t`marker ${marker}, ${i18n._(CORNERS[corner] as MessageDescriptor)}`;
}

function failureOf(result: TouchFit, known: readonly KnownPoint[]): string {
  if (!("problem" in result)) return "";
  if (result.problem === "line") return t`The touched points are on a line. Touch the named corners again.`;
  if (result.points.length === 3) return t`The touched points contradict each other. Touch all of them again.`;
  const names = result.points.map((n) => nameOf(known[n])).join("; ");
  return t`Not where it should be: ${names}. Touch the points again, or measure the marker.`;
}
