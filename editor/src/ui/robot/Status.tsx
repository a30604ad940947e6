/** State of the robot: the pose of its tool, its grippers, its alarms. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { acknowledgeStop, armOf, effectorPose, featuresOf, notReady, type RobotSelection } from "../../commands/robot";
import { fixed } from "../../formats";
import { translatedAlarm } from "../../i18n/serverMessages";
import { useEditor } from "../../store/store";
import { rollPitchYaw } from "../../viewmodel/rotations";
import { Button } from "../kit/kit";
import { useTelemetry } from "./useTelemetry";

export function Status({ chosen }: { chosen: RobotSelection }) {
  const { robotId } = chosen;
  const alarms = useEditor((state) => state.live.health[robotId]?.alarms);
  const acknowledges = useEditor((state) => featuresOf(state, robotId)?.acknowledge_stop ?? false);
  const arm = useEditor((state) => armOf(state, chosen));
  const why = useEditor((state) => notReady(state, chosen, "AcknowledgeStop"));
  const [refused, setRefused] = useState("");
  const tools = [
    [t`Grippers`, arm?.grippers ?? []],
    [t`Suction cups`, arm?.suctions ?? []],
  ] as const;
  return (
    <div className="robot-status">
      <Pose chosen={chosen} />
      {tools.map(
        ([title, names]) =>
          names.length > 0 && <p key={title} className="quiet small">{`${title}: ${names.join(", ")}`}</p>,
      )}
      {alarms?.map(translatedAlarm).map((alarm) => (
        <p key={alarm.code} className="small alarm" role="alert">
          {alarm.text} {alarm.remedy && <span className="quiet">{alarm.remedy}</span>}
        </p>
      ))}
      {acknowledges && alarms && alarms.length > 0 && (
        <Button why={why} onPress={() => void acknowledgeStop(robotId).then(setRefused)}>
          {t`Acknowledge`}
        </Button>
      )}
      {refused && (
        <p className="error small" role="alert">
          {refused}
        </p>
      )}
    </div>
  );
}

function Pose({ chosen }: { chosen: RobotSelection }) {
  const pose = useTelemetry(chosen.robotId, () => effectorPose(chosen));
  if (!pose) return <p className="quiet small">{t`Tool pose unknown.`}</p>;
  const { x, y, z } = pose.position;
  const angles = rollPitchYaw(pose.orientation);
  return (
    <dl className="robot-pose" aria-label={t`Tool pose in the world`}>
      {(["x", "y", "z"] as const).map((axis, n) => (
        <div key={axis}>
          <dt>{axis}</dt>
          <dd>{fixed(([x, y, z][n] ?? 0) * 1000, 1)} mm</dd>
          <dd>{fixed(angles[n] ?? 0, 1)}°</dd>
        </div>
      ))}
    </dl>
  );
}
