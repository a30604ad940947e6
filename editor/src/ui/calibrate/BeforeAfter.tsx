/** The change of the pose of an object by a calibration, to be accepted or reverted. */

import { t } from "@lingui/core/macro";
import { useEffect } from "react";
import { forgetOldPose, placeAt } from "../../commands/calibrate";
import { hideGhost, showGhostWithBase } from "../../commands/robot";
import { fixed } from "../../formats";
import { getState, useEditor } from "../../store/store";
import { notMovable } from "../../transform/target";
import { apart } from "../../viewmodel/frames";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";

/** Smallest change, m and degrees; less is numerical noise. */
const NOTHING = 1e-6;

export function BeforeAfter({ id }: { id: string }) {
  const was = useEditor(({ ui }) => (ui.beforeCalibration?.id === id ? ui.beforeCalibration.pose : null));
  const pose = useEditor((state) => state.doc?.objects[id]?.pose);
  const isRobot = useEditor((state) => (state.doc?.objects[id]?.type ?? "") in state.types.robots);
  const why = useEditor((state) => notMovable(state, { kind: "object", id }));
  const { refused, busy, ask } = useRefusal();
  const moved = was && pose ? apart(was, pose) : null;
  const shown = moved !== null && (moved.distance > NOTHING || moved.degrees > NOTHING);
  useEffect(() => {
    if (!shown || !isRobot || !was) return;
    showGhostWithBase(id, was);
    return () => {
      if (getState().ui.ghost?.at === was) hideGhost();
    };
  }, [shown, isRobot, id, was]);
  if (!shown || !was) return null;
  return (
    <div className="before-after" role="group" aria-label={t`Before and after`}>
      <p role="status">
        {t`Moved by ${fixed(moved.distance * 1000, 1)} mm and ${fixed(moved.degrees, 2)}°.`}
        {isRobot && <span className="quiet small"> {t`Transparent: previous pose.`}</span>}
      </p>
      <div className="actions start">
        <Button variant="primary" onPress={forgetOldPose}>
          {t`Keep the new pose`}
        </Button>
        <Button
          why={why}
          isDisabled={busy}
          onPress={() => void ask(placeAt(id, was)).then((done) => done && forgetOldPose())}
        >
          {t`Restore the old pose`}
        </Button>
      </div>
      <RefusedText>{refused}</RefusedText>
    </div>
  );
}
