/** Texts about the quality of AR, with remedies. */

import { plural, t } from "@lingui/core/macro";
import { decimal } from "../../formats";
import type { Ar } from "../../store/ui";

/** Return the quality in words: expected error, number of markers, age. */
export function qualityOf({ error, used, touched, seenAt, checked, nudge }: Ar, present = Date.now()): string {
  const age = Math.round((present - seenAt) / 1000);
  const size = decimal(Math.max(1, error * 1000), 0);
  const markers = touched
    ? plural(touched, { one: "# point", other: "# points" })
    : plural(used.length, { one: "# marker", other: "# markers" });
  const when = age < 1 ? t`now` : t`${age} s ago`;
  if (nudge) return t`${movementOf(nudge)}, ${markers}, ${when}`;
  return checked ? t`±${size} mm, ${markers}, ${when}` : t`±${size} mm, unchecked, ${markers}, ${when}`;
}

/** Return a movement by hand in mm and degrees. */
function movementOf({ distance, angle }: NonNullable<Ar["nudge"]>): string {
  return `${decimal(distance * 1000, 0)} mm, ${decimal((Math.abs(angle) * 180) / Math.PI, 1)}°`;
}

/** Return the grade as a word, a shape and a tone. */
export function gradeOf(ar: Ar): { word: string; shape: string; tone: string } {
  if (ar.frozen) return { word: t`Frozen`, shape: "❚❚", tone: "fair" };
  if (ar.phase === "starting" || ar.phase === "looking") {
    return { word: ar.configured ? t`Looking for markers` : t`Not placed`, shape: "○", tone: "rough" };
  }
  if (ar.phase === "hand") return { word: t`Placed by hand`, shape: "▢", tone: "fair" };
  if (ar.phase === "lost" && ar.mode !== "camera") return { word: t`Position lost`, shape: "⊘", tone: "rough" };
  if (ar.phase === "tracked" && !ar.nudge) {
    const tone = ar.drifted || ar.grade === "rough" ? "rough" : "fair";
    return ar.touched ? { word: t`By touch`, shape: "◎", tone } : { word: t`Tracked`, shape: "◍", tone };
  }
  if (!["registered", "tracked"].includes(ar.phase)) return { word: t`No marker in sight`, shape: "◇", tone: "rough" };
  if (ar.nudge) return { word: t`Moved by hand`, shape: "◆", tone: "fair" };
  if (ar.grade === "good") return { word: t`Good`, shape: "●", tone: "good" };
  if (ar.grade === "fair") return { word: t`Fair`, shape: "◐", tone: "fair" };
  return { word: t`Rough`, shape: "△", tone: "rough" };
}

/** Return the advice that only concerns devices that track themselves; an empty string if there is none. */
function xrAdviceOf({ phase, mode, configured, touched, pictures, drifted, grade }: Ar): string {
  if (phase === "lost") return t`The device has lost its position. Move it slowly, in good light.`;
  if (phase === "hand") return t`The device tracks its own position. Check the overlay from time to time.`;
  if (phase === "looking" && mode === "headset" && configured > 0) {
    return t`Press Touch points, then touch three corners of markers.`;
  }
  if (phase === "looking" && configured === 0) {
    return t`Look at a surface, and press Place. The device then tracks its own position.`;
  }
  if (phase === "looking" && !pictures) {
    return t`The browser gives AR no pictures of markers. Press Place, or start again with the camera only.`;
  }
  if (phase === "tracked" && drifted) {
    return touched
      ? t`The position drifts as you move. Touch the points again.`
      : t`The position drifts as you move. Show a marker again.`;
  }
  if (touched && grade === "rough") {
    return t`The touched points are close to each other. Configure markers that are farther apart.`;
  }
  return "";
}

/** Return what the user can do for a better registration, most important first; an empty string if it is good. */
export function adviceOf(ar: Ar): string {
  const { phase, loss, used, contradicting, undecided, checked, corrected, grade, configured, sensor } = ar;
  if (ar.mode !== "camera") {
    const advice = xrAdviceOf(ar);
    if (advice) return advice;
  } else if (phase === "hand") {
    return sensor
      ? t`The overlay turns with the device. After a step, place it again.`
      : t`The overlay does not follow the camera. Hold the device still.`;
  }
  if (phase === "looking" && configured === 0) return t`Press Place to place the workplace by hand.`;
  if (phase === "lost" || phase === "looking") {
    if (loss === "dark") return t`It is too dark for the camera. Switch on the light.`;
    if (loss === "blurred") return t`The picture is blurred. Move more slowly.`;
    return t`Point the camera at a marker.`;
  }
  if (corrected > 0) return t`The overlay was corrected by ${decimal(corrected * 1000, 0)} mm.`;
  if (undecided)
    return t`Markers ${used.join(", ")} contradict each other. Show another marker, or measure them again.`;
  if (contradicting.length > 0) {
    return t`Marker ${contradicting.join(", ")} is not where it should be, and is left out. Measure it again.`;
  }
  if (used.length === 1 && grade !== "good") return t`Show a second marker.`;
  if (!checked) return t`The lens is not known yet. Walk around the markers with two or more in view.`;
  return "";
}
