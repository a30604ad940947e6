/** Which kinematics a robot uses: calibrated in its controller, or nominal. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { featuresOf } from "../../commands/robot";
import { ago } from "../../formats";
import { type RobotKinematics, readKinematics } from "../../session/kinematics";
import { useEditor } from "../../store/store";

export function Kinematics({ robotId }: { robotId: string }) {
  const reports = useEditor((state) => featuresOf(state, robotId)?.kinematic_calibration ?? false);
  // The calibration can change while the robot is online, which a notification reports.
  const lastNotice = useEditor((state) => state.notices.at(-1)?.id);
  const scene = useEditor((state) => state.live.state);
  const [found, setFound] = useState<RobotKinematics | null>(null);
  useEffect(() => {
    if (!reports) return;
    let ended = false;
    const show = (answer: RobotKinematics | null) => ended || setFound(answer);
    readKinematics(robotId).then(show, () => show(null));
    return () => {
      ended = true;
    };
  }, [robotId, reports, lastNotice, scene]);
  if (!reports || found?.object_id !== robotId) return null;
  return <p className="quiet small">{sentence(found)}</p>;
}

function sentence({ in_force: force, read, refused }: RobotKinematics): string {
  if (force === "measured")
    return read ? t`Uses this robot's calibration, read ${ago(read)}.` : t`Uses this robot's calibration.`;
  if (refused) return t`Uses the nominal kinematics. The calibration of the controller is not used: ${refused}`;
  return t`Uses the nominal kinematics. Go online to read the calibration of this robot.`;
}
