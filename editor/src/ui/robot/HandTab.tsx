/** The arm made movable by hand, as long as the button is held. */

import { useState } from "react";
import { holdHandTeaching } from "../../commands/holds";
import { type Chosen, featuresOf, notReady } from "../../commands/robot";
import { useEditor } from "../../store/store";
import { HoldButton } from "./HoldButton";

export function HandTab({ chosen }: { chosen: Chosen }) {
  const can = useEditor((state) => featuresOf(state, chosen.robotId)?.hand_teaching ?? false);
  const ready = useEditor((state) => notReady(state, chosen, "HoldHandTeaching"));
  const free = useEditor((state) => state.live.handTeaching[chosen.robotId] ?? false);
  const [refused, setRefused] = useState("");
  return (
    <>
      <p className="quiet small">As long as the button is held, the arm can be moved by hand. Let go, and it is stiff again.</p>
      <HoldButton
        label="Hold, and move the arm by hand"
        className="primary large"
        why={ready || (can ? "" : "This robot cannot be moved by hand.")}
        onHold={() => {
          setRefused("");
          return holdHandTeaching(chosen.robotId, chosen.armId || undefined);
        }}
        onOver={setRefused}
      >
        Hold to teach by hand
      </HoldButton>
      <p role="status" className={`tag ${free ? "warn" : ""}`}>
        {free ? "The arm is free" : "The arm is stiff"}
      </p>
      {refused && (
        <p className="error small" role="alert">
          {refused}
        </p>
      )}
    </>
  );
}
