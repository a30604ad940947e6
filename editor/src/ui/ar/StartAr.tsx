/** An explanation of AR before the browser asks for the camera; or the reason why AR cannot start, with a remedy. */

import { plural, t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import type { Layout } from "../../ar/places";
import { type ArMethod, ArProblem, abilitiesOf, methodsOf, obstacleOf } from "../../ar/support";
import { loadMarkers, loadMethod, startAr } from "../../commands/ar";
import { notify } from "../../store/store";
import { ModalDialog } from "../kit/dialogs";
import { Button, Waiting } from "../kit/kit";
import { reasonOf } from "./reasons";

export default function StartAr({ onClose }: { onClose: () => void }) {
  const [layout, setLayout] = useState<Layout | null>(null);
  const [failure, setFailure] = useState("");
  const [obstacle, setObstacle] = useState(() => obstacleOf(abilitiesOf(globalThis), null));
  const [opening, setOpening] = useState(false);
  const [methods, setMethods] = useState<ArMethod[]>(["camera"]);
  useEffect(() => {
    let over = false;
    void methodsOf(globalThis).then((found) => {
      if (over) return;
      for (const method of found) loadMethod(method).catch(() => {}); // again by the start
      if (found.includes("xr")) setObstacle((before) => (before === "browser" ? null : before));
      if (found.length > 0) setMethods(found);
    });
    loadMarkers()
      .then((found) => {
        if (over) return;
        setLayout(found);
        setObstacle(obstacleOf(abilitiesOf(globalThis), found));
      })
      .catch((error: unknown) => over || setFailure(error instanceof Error ? error.message : String(error)));
    return () => {
      over = true;
    };
  }, []);
  const start = (method: ArMethod) => {
    if (!layout) return;
    setOpening(true);
    startAr(layout, method, (reason) => notify("error", reasonOf(reason, layout.dictionary)))
      .then(onClose)
      .catch((error: unknown) => {
        setOpening(false);
        setObstacle(error instanceof ArProblem ? error.obstacle : "missing");
      });
  };
  const permanent = obstacle === "insecure" || obstacle === "browser";
  const byHand = obstacle === "markers" || obstacle === "dictionary";
  const count = layout?.places.size ?? 0;
  return (
    <ModalDialog title={t`Augmented reality`} onClose={onClose}>
      {!permanent && (
        <>
          <p>
            {t`The 3D view appears over the picture of the camera. Markers in the workplace show where the camera is.`}
          </p>
          <p className="quiet">
            {methods[0] === "xr"
              ? t`The device tracks its own position. The browser asks for AR, and for the camera to find markers.`
              : t`The browser asks for the camera, and on an iPad also for the motion sensor.`}{" "}
            {t`Pictures stay on this device.`}
          </p>
        </>
      )}
      {(obstacle || failure) && (
        <p role="alert" className={byHand ? "" : "notice-line bad"}>
          {obstacle ? reasonOf(obstacle, layout?.dictionary ?? "") : failure}
        </p>
      )}
      {byHand && <p>{t`Without markers, you place the workplace in the picture by hand.`}</p>}
      {!layout && !failure && !obstacle && <Waiting>{t`Loading…`}</Waiting>}
      {count > 0 && !permanent && (
        <p className="quiet small">
          {plural(count, { one: "# marker is configured.", other: "# markers are configured." })}
        </p>
      )}
      <div className="actions">
        <Button onPress={onClose}>{permanent ? t`Close` : t`Cancel`}</Button>
        {!permanent && (
          <>
            {methods.length > 1 && (
              <Button isDisabled={!layout || opening} onPress={() => start("camera")}>
                {t`Camera only`}
              </Button>
            )}
            <Button
              variant="primary"
              icon="camera"
              isDisabled={!layout || opening}
              onPress={() => start(methods[0] ?? "camera")}
              autoFocus
            >
              {t`Start AR`}
            </Button>
          </>
        )}
      </div>
    </ModalDialog>
  );
}
