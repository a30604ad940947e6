/** Move a robot out of a zone that it may not use, for example after a stop: slowly, while a button is held. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { holdJog } from "../../commands/holdToRun";
import { featuresOf, notReady, type RobotSelection } from "../../commands/robot";
import { useEditor } from "../../store/store";
import { HoldButton } from "../robot/HoldButton";
import { useInterlocks } from "./useInterlocks";

export function LeaveZone({ chosen }: { chosen: RobotSelection }) {
  const found = useInterlocks();
  const objects = useEditor((state) => state.doc?.objects);
  const why = useEditor((state) => notReady(state, chosen, "JogRobot"));
  const jogs = useEditor((state) => featuresOf(state, chosen.robotId)?.jog === true);
  const [refused, setRefused] = useState("");
  const { robotId } = chosen;
  const blocked = found?.interlocks.find((each) => {
    const state = found.states[each.id];
    return state?.inside?.includes(robotId) && (state.owner !== robotId || (each.during && state.state !== "met"));
  });
  if (!blocked || !jogs) return null;
  const zone = objects?.[blocked.object_id]?.name ?? blocked.name;
  const reason = found?.states[blocked.id]?.text;
  return (
    <div className="leave-zone">
      <p>
        {t`The robot is in the zone ${zone}, which it may not use now.`} {reason}
      </p>
      <HoldButton
        label={t`Hold to leave ${zone}`}
        why={why}
        onHold={() => {
          setRefused("");
          return holdJog(robotId, { retract: true });
        }}
        onOver={setRefused}
      >
        {t`Hold to leave ${zone}`}
      </HoldButton>
      <p className="quiet small" role="status">
        {refused || t`It moves slowly out of the zone as long as you hold the button. Watch the robot.`}
      </p>
    </div>
  );
}
