/** Controls of AR over the picture of the camera: quality, freeze, markers, and the ways out. */

import { plural, t } from "@lingui/core/macro";
import { useLayoutEffect } from "react";
import { freezeAr, leaveAr, recalibrateAr, showMarkers } from "../../commands/ar";
import type { Engine } from "../../engine/engine";
import { decimal } from "../../formats";
import { useEditor } from "../../store/store";
import type { Ar } from "../../store/ui";
import { Button } from "../kit/kit";
import { useTicking } from "../times";
import { MarkerOutlines } from "./MarkerOutlines";
import "./ar.css";

/** Time after which a rest is suggested, ms. */
const REST = 30 * 60_000;
/** Time after which a missing sight is worth a word, ms. */
const NOTICED = 1000;

/** Return the quality in words: expected error, number of markers, age. */
function qualityOf({ error, used, seenAt, checked }: Ar): string {
  const age = Math.round((Date.now() - seenAt) / 1000);
  const size = decimal(Math.max(1, error * 1000), 0);
  const markers = plural(used.length, { one: "# marker", other: "# markers" });
  const when = age < 1 ? t`now` : t`${age} s ago`;
  return checked ? t`±${size} mm, ${markers}, ${when}` : t`±${size} mm, unchecked, ${markers}, ${when}`;
}

function gradeOf(ar: Ar): { word: string; shape: string; look: string } {
  if (ar.frozen) return { word: t`Frozen`, shape: "❚❚", look: "fair" };
  if (ar.phase === "starting" || ar.phase === "looking")
    return { word: t`Looking for markers`, shape: "○", look: "rough" };
  if (ar.phase === "lost" || ar.phase === "bridging") return { word: t`No marker in sight`, shape: "◇", look: "rough" };
  if (ar.grade === "good") return { word: t`Good`, shape: "●", look: "good" };
  if (ar.grade === "fair") return { word: t`Fair`, shape: "◐", look: "fair" };
  return { word: t`Rough`, shape: "△", look: "rough" };
}

/** Return what the user can do for a better registration, most important first; an empty string if it is good. */
function adviceOf(ar: Ar): string {
  const { phase, loss, used, contradicting, undecided, checked, corrected, grade } = ar;
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

/** The word of a button; on a phone, only its icon is visible. */
function Word({ children }: { children: string }) {
  return <span className="ar-word">{children}</span>;
}

export default function ArView({ engine }: { engine: Engine }) {
  const ar = useEditor((state) => state.ui.ar);
  useTicking(1);
  // Before the view is closed.
  useLayoutEffect(() => () => leaveAr(), []);
  if (!ar) return null;
  const { word, shape, look } = gradeOf(ar);
  const registered = ar.seenAt > 0;
  const stale = ar.phase === "bridging" && Date.now() - ar.seenAt < NOTICED;
  const advice = stale || ar.frozen ? "" : adviceOf(ar);
  return (
    <>
      {ar.markers && <MarkerOutlines engine={engine} />}
      <div className="view-controls ar-controls" role="group" aria-label={t`Augmented reality`}>
        <Button icon="close" onPress={() => leaveAr()}>
          <Word>{t`Leave AR`}</Word>
        </Button>
        <Button icon={ar.frozen ? "play" : "pause"} onPress={() => freezeAr(!ar.frozen)} aria-pressed={ar.frozen}>
          <Word>{ar.frozen ? t`Continue` : t`Freeze`}</Word>
        </Button>
        <Button icon="eye" onPress={() => leaveAr(true)}>
          <Word>{t`Seat view`}</Word>
        </Button>
        <Button icon="zoom" onPress={() => showMarkers(!ar.markers)} aria-pressed={ar.markers}>
          <Word>{t`Markers`}</Word>
        </Button>
        <Button icon="redo" onPress={recalibrateAr}>
          <Word>{t`Recalibrate`}</Word>
        </Button>
      </div>
      <div className={`ar-status ${look}`} data-phase={ar.phase} role="group" aria-label={t`Quality of AR`}>
        <p>
          <span aria-hidden="true">{shape}</span> <strong role="status">{word}</strong>{" "}
          {registered && <span className="ar-quality">{qualityOf(ar)}</span>}
        </p>
        {advice && <p className="small">{advice}</p>}
        {Date.now() - ar.startedAt > REST && (
          <p className="small">{t`You have used AR for half an hour. Seat view continues here without the camera.`}</p>
        )}
      </div>
    </>
  );
}
