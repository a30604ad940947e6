/** Controls of AR on the page: quality, freeze, markers, placing, and leaving AR. */

import { t } from "@lingui/core/macro";
import { Suspense } from "react";
import { freezeAr, leaveAr, openPlacing, recalibrateAr, showMarkers } from "../../commands/ar";
import type { Engine } from "../../engine/engine";
import type { Ar } from "../../store/ui";
import { Button } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import { MarkerOutlines } from "./MarkerOutlines";
import { PlaceByHand } from "./PlaceByHand";
import { adviceOf, gradeOf, qualityOf } from "./texts";
import "./ar.css";

const SelectList = lazyComponent(() => import("./SelectList"));

/** Time after which a rest is suggested, ms. */
const REST = 30 * 60_000;
/** Time without a marker after which advice is shown, ms. */
const STALE_AFTER = 1000;

/** The word of a button; on a phone, only its icon is visible. */
function Word({ children }: { children: string }) {
  return <span className="ar-word">{children}</span>;
}

export default function ArControls({ engine, ar }: { engine: Engine; ar: Ar }) {
  const { word, shape, tone } = gradeOf(ar);
  const registered = ar.seenAt > 0 && ar.phase !== "hand";
  const stale = ar.phase === "bridging" && Date.now() - ar.seenAt < STALE_AFTER;
  const advice = stale || ar.frozen ? "" : adviceOf(ar);
  return (
    <>
      {ar.mode === "tablet" && (
        <Suspense fallback={null}>
          <SelectList />
        </Suspense>
      )}
      {ar.markers && <MarkerOutlines />}
      <div className="view-controls ar-controls" role="group" aria-label={t`Augmented reality`}>
        <Button icon="close" onPress={() => leaveAr()}>
          <Word>{t`Leave AR`}</Word>
        </Button>
        {ar.pictures && (
          <Button icon={ar.frozen ? "play" : "pause"} onPress={() => freezeAr(!ar.frozen)} aria-pressed={ar.frozen}>
            <Word>{ar.frozen ? t`Continue` : t`Freeze`}</Word>
          </Button>
        )}
        <Button icon="eye" onPress={() => leaveAr(true)}>
          <Word>{t`3D view`}</Word>
        </Button>
        <Button icon="zoom" onPress={() => showMarkers(!ar.markers)} aria-pressed={ar.markers}>
          <Word>{t`Markers`}</Word>
        </Button>
        <Button icon="box" onPress={() => openPlacing(!ar.placing)} aria-pressed={ar.placing}>
          <Word>{t`Place`}</Word>
        </Button>
        <Button icon="redo" onPress={recalibrateAr}>
          <Word>{t`Recalibrate`}</Word>
        </Button>
      </div>
      <div className="ar-corner">
        {ar.placing && <PlaceByHand engine={engine} ar={ar} />}
        <div className={`ar-status ${tone}`} data-phase={ar.phase} role="group" aria-label={t`Quality of AR`}>
          <p>
            <span aria-hidden="true">{shape}</span> <strong role="status">{word}</strong>{" "}
            {registered && <span className="ar-quality">{qualityOf(ar)}</span>}
          </p>
          {advice && <p className="small">{advice}</p>}
          {Date.now() - ar.startedAt > REST && (
            <p className="small">
              {t`You have used AR for half an hour. Press 3D view to continue without the camera.`}
            </p>
          )}
        </div>
      </div>
    </>
  );
}
