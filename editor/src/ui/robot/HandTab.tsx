/** Hand teaching: the arm can be moved by hand as long as the button is held. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { holdHandTeaching } from "../../commands/holdToRun";
import { featuresOf, notReady, type RobotSelection } from "../../commands/robot";
import { useEditor } from "../../store/store";
import { HoldButton } from "./HoldButton";
import { PadDock } from "./PadDock";

export function HandTab({ chosen }: { chosen: RobotSelection }) {
  const can = useEditor((state) => featuresOf(state, chosen.robotId)?.hand_teaching ?? false);
  const ready = useEditor((state) => notReady(state, chosen, "HoldHandTeaching"));
  const free = useEditor((state) => state.live.handTeaching[chosen.robotId] ?? false);
  const [refused, setRefused] = useState("");
  const cannot = ready || (can ? "" : t`This robot does not support hand teaching.`);
  return (
    <>
      <p className="quiet small">
        {t`Hold the button and move the arm by hand. The arm locks when you release the button.`}
      </p>
      <p role="status">
        <span className={`tag ${free ? "warn" : ""}`}>{free ? t`Hand teaching is on` : t`Hand teaching is off`}</span>
      </p>
      <PadDock chosen={chosen} refused={refused} hint={cannot}>
        <HoldButton
          label={t`Hold to teach: move the arm by hand`}
          className="primary large"
          why={cannot}
          onHold={() => {
            setRefused("");
            return holdHandTeaching(chosen.robotId, chosen.armId || undefined);
          }}
          onOver={setRefused}
        >
          {t`Hold to teach`}
        </HoldButton>
      </PadDock>
    </>
  );
}
